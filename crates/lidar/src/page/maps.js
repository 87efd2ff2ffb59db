// Maps of the array with one pointer: camera, guide, truth, depth with the reason where there is none, error, confidence.

const MAPS = [
  { name: "camera", title: "Camera view", of: (f) => f.camera, across: meta.across, scale: GREYS, range: () => [0, 255], say: (f, p) => meta.objects[f.object[p] - 1] ?? "sky" },
  { name: "guide", title: "Guide", of: (f) => f.guide, scale: DEPTHS, range: () => meta.scale_m, unit: "m", patternAt: (f, p) => (Number.isFinite(f.guide[p]) ? null : patternOf(Number.isFinite(f.truth[p]) ? "no guide" : "no surface")) },
  { name: "truth", title: "Truth", of: (f) => f.truth, scale: DEPTHS, range: () => meta.scale_m, unit: "m", patternAt: (f, p) => (Number.isFinite(f.truth[p]) ? null : patternOf("no surface")) },
  { name: "depth", title: "Depth", of: (f) => f.depth, scale: DEPTHS, range: () => meta.scale_m, unit: "m", patternAt: (f, p) => meta.reasons[f.reason[p] - 1], say: (f, p) => (f.reason[p] ? reasonOf(f, p) : shown(f.depth[p], 2, "m")) },
  { name: "error", title: "Error, depth less truth", of: (f) => f.error, scale: DIVERGING, range: errors, unit: "m", digits: 3 },
  { name: "confidence", title: "Confidence", of: (f) => f.confidence, scale: INFERNO, range: confidences, by: Math.log1p, unit: "", digits: 1 },
];

function confidences(f) {
  return [0, Math.max(1, quantile(f.confidence, 0.98) || 0)];
}

function errors(f) {
  const most = Math.max(0.01, quantile(f.error.map(Math.abs), 0.95) || 0);
  return [-most, most];
}

const patternOf = (name) => meta.reasons.find((reason) => reason.name === name);
const reasonOf = (f, p) => (f.reason[p] ? meta.reasons[f.reason[p] - 1].name : "depth");
const shown = (value, digits, unit) => (Number.isFinite(value) ? value.toFixed(digits) + (unit ? " " + unit : "") : "–");

function makeMaps(section, onPoint) {
  for (const map of MAPS) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const [name, value] = [document.createElement("b"), document.createElement("span")];
    name.textContent = map.title;
    caption.append(name, value);
    const box = document.createElement("div");
    box.className = "map";
    box.title = map.title;
    box.id = "map-" + map.name;
    box.style.aspectRatio = meta.cols + " / " + meta.rows * meta.aspect;
    const canvas = document.createElement("canvas");
    const marks = ["line across", "line down", "cross"].map((kind) => {
      const mark = document.createElement("div");
      mark.className = kind;
      return mark;
    });
    box.append(canvas, ...marks);
    const bar = document.createElement("div");
    bar.className = "bar";
    figure.append(caption, box, bar);
    section.append(figure);
    Object.assign(map, { box, canvas, bar, marks, value });
    const point = (event) => {
      const at = box.getBoundingClientRect();
      const within = (x, size, n) => Math.min(n - 1, Math.max(0, Math.floor((x / size) * n)));
      onPoint(within(event.clientY - at.top, at.height, meta.rows), within(event.clientX - at.left, at.width, meta.cols));
    };
    box.addEventListener("pointerdown", (event) => {
      if (event.isTrusted) box.setPointerCapture(event.pointerId);
      point(event);
    });
    box.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) point(event);
    });
  }
}

function drawMaps(f) {
  for (const map of MAPS) {
    const [least, most] = map.range(f);
    const by = map.by ?? ((value) => value);
    const across = map.across ?? 1;
    const colours = map.of(f).map(by);
    const colourAt = (cell) => shade(map.scale, (colours[cell] - by(least)) / (by(most) - by(least)));
    const patternAt = (cell) => map.patternAt?.(f, cell);
    paint(map.canvas, [meta.rows * across, meta.cols * across], colourAt, patternAt);
    legendOf(map, f, least, most);
  }
}

// Whether every pixel of the screen has its own in the maps: not after the window has changed.
const areMapsSharp = () => MAPS.every(({ box, canvas }) => screenSize(box)[0] === canvas.width);

function legendOf(map, f, least, most) {
  map.bar.replaceChildren();
  const text = (words) => {
    const span = document.createElement("span");
    span.textContent = words;
    return span;
  };
  if (map.name === "camera") return;
  const strip = document.createElement("div");
  strip.className = "ramp";
  strip.style.background = ramp(map.scale);
  const digits = most - least > 20 ? 0 : most - least > 2 ? 1 : 2;
  map.bar.append(text(least.toFixed(digits)), strip, text(shown(most, digits, map.unit)));
  if (map.by) map.bar.title = "logarithmic";
  if (map.name !== "depth") return;
  const reasons = document.createElement("div");
  reasons.className = "reasons";
  reasons.append(...reasonsOf(f).map(([reason, count]) => {
    const [entry, sample] = [text(reason.name + " " + count), document.createElement("canvas")];
    sample.className = "sample";
    entry.prepend(sample);
    paintSample(sample, reason);
    return entry;
  }));
  map.bar.append(reasons);
}

// Reasons that occur, each with the number of its macropixels, in their order.
function reasonsOf(f) {
  const counts = meta.reasons.map((reason, at) => [reason, f.reason.reduce((n, why) => n + (why === at + 1), 0)]);
  return counts.filter(([, count]) => count > 0);
}

function pointMaps(f, row, col) {
  const pixel = row * meta.cols + col;
  const [x, y] = [100 / meta.cols, 100 / meta.rows];
  for (const map of MAPS) {
    const [across, down, cross] = map.marks;
    across.style.top = (row + 0.5) * y + "%";
    down.style.left = (col + 0.5) * x + "%";
    Object.assign(cross.style, { left: col * x + "%", top: row * y + "%", width: x + "%", height: y + "%" });
    map.value.textContent = map.say ? map.say(f, pixel) : shown(map.of(f)[pixel], map.digits ?? 2, map.unit);
  }
}
