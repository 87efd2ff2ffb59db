// The recording: names and numbers at once, the arrays of a frame when it is looked at.

const meta = JSON.parse(document.getElementById("meta").textContent);
const pixels = meta.rows * meta.cols;
const cached = new Map();

async function inflated(text) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

// In the order of packed.rs. Arrays are copied out: not all begin where their type may.
function unpacked(buffer) {
  let at = 0;
  const take = (Type, length) => {
    const end = at + length * Type.BYTES_PER_ELEMENT;
    const array = new Type(buffer.slice(at, end));
    at = end;
    return array;
  };
  const frame = {};
  for (const name of ["truth", "guide", "depth", "bound", "spread", "peak", "confidence", "signal", "background"]) {
    frame[name] = take(Float32Array, pixels);
  }
  for (const name of ["returns", "returnBounds", "returnPhotons"]) {
    frame[name] = Array.from({ length: meta.returns }, () => take(Float32Array, pixels));
  }
  frame.edges = take(Uint32Array, pixels);
  frame.start = take(Int16Array, pixels);
  frame.object = take(Uint16Array, pixels);
  frame.histograms = take(Uint16Array, pixels * meta.bins);
  const reason = take(Uint8Array, pixels);
  frame.reason = reason.map((why) => why & 127);
  frame.inWindow = reason.map((why) => why >> 7);
  frame.camera = take(Uint8Array, pixels * meta.across * meta.across);
  frame.error = frame.depth.map((depth, pixel) => depth - frame.truth[pixel]);
  return frame;
}

async function frameAt(number) {
  if (!cached.has(number)) {
    // A drive of any length is looked at in the memory of some frames.
    if (cached.size > 40) cached.delete(cached.keys().next().value);
    const text = document.getElementById("frame-" + number).textContent;
    cached.set(number, inflated(text).then(unpacked));
  }
  return cached.get(number);
}

// Numbers of a macropixel's returns after its depth's.
const further = (f, pixel) => f.returns.map((_, n) => n).filter((n) => n > 0 && Number.isFinite(f.returns[n][pixel]));

// The value below which a share of those that exist lie.
function quantile(values, share) {
  const sorted = Array.from(values).filter(Number.isFinite).sort((a, b) => a - b);
  return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : NaN;
}
