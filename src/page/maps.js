// Maps of the array with one pointer: camera, guide, truth, depth, error, confidence, reason.

const everyDepth = { least: Infinity, most: 0 };

const MAPS = [
  { name: "camera", title: "Camera view", of: (f) => f.camera, across: meta.across, scale: GREYS, range: () => [0, 255], say: (f, p) => meta.objects[f.object[p] - 1] ?? "sky" },
  { name: "guide", title: "Guide", of: (f) => f.guide, scale: VIRIDIS, range: depths, by: Math.log, unit: "m" },
  { name: "truth", title: "Truth", of: (f) => f.truth, scale: VIRIDIS, range: depths, by: Math.log, unit: "m" },
  { name: "depth", title: "Depth", of: (f) => f.depth, scale: VIRIDIS, range: depths, by: Math.log, unit: "m" },
  { name: "error", title: "Error", of: (f) => f.error, scale: DIVERGING, range: errors, unit: "m", digits: 3 },
  { name: "confidence", title: "Confidence", of: (f) => f.confidence, scale: INFERNO, range: confidences, by: Math.log1p, unit: "", digits: 1 },
  { name: "reason", title: "Reason", of: (f) => Float32Array.from(f.reason), scale: steps(), range: () => [-0.5, REASONS.length - 0.5], say: (f, p) => reasonOf(f, p) },
];

// Frames of a drive share the scale that the widest of those seen so far asks for.
function depths(f) {
  for (const map of [f.truth, f.depth]) {
    const [least, most] = [quantile(map, 0.01), quantile(map, 0.99)];
    if (Number.isFinite(least)) {
      everyDepth.least = Math.min(everyDepth.least, least);
      everyDepth.most = Math.max(everyDepth.most, most);
    }
  }
  return everyDepth.most > 0 ? [Math.max(0.1, everyDepth.least), Math.max(everyDepth.most, everyDepth.least + 1)] : [0.1, 1];
}

function confidences(f) {
  return [0, Math.max(1, quantile(f.confidence, 0.98) || 0)];
}

function errors(f) {
  const most = Math.max(0.01, quantile(f.error.map(Math.abs), 0.95) || 0);
  return [-most, most];
}

function steps() {
  const n = REASONS.length;
  return REASONS.flatMap((c, at) => [[at / n, c], [(at + 1) / n, c]]);
}

const reasonOf = (f, p) => (f.reason[p] ? meta.reasons[f.reason[p] - 1] : "depth found");
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
    const plot = document.createElement("div");
    plot.className = "plot";
    const marks = ["line across", "line down", "cross"].map((kind) => {
      const mark = document.createElement("div");
      mark.className = kind;
      return mark;
    });
    box.append(plot, ...marks);
    const bar = document.createElement("div");
    bar.className = "bar";
    figure.append(caption, box, bar);
    section.append(figure);
    Object.assign(map, { box, plot, bar, marks, value });
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
    const cols = meta.cols * (map.across ?? 1);
    const [least, most] = map.range(f);
    const by = map.by ?? ((value) => value);
    const trace = { type: "heatmap", z: rowsOf(map.of(f).map(by), cols), colorscale: map.scale, zmin: by(least), zmax: by(most), showscale: false, hoverinfo: "skip", zsmooth: false };
    const bare = { visible: false, fixedrange: true };
    Plotly.react(map.plot, [trace], layout({ margin: { l: 0, r: 0, t: 0, b: 0 }, xaxis: bare, yaxis: { ...bare, autorange: "reversed" } }), { staticPlot: true, responsive: true });
    legendOf(map, f, least, most);
  }
}

function legendOf(map, f, least, most) {
  map.bar.replaceChildren();
  const text = (words) => {
    const span = document.createElement("span");
    span.textContent = words;
    return span;
  };
  if (map.name === "reason") {
    const there = new Set(f.reason);
    for (const why of [...there].sort((a, b) => a - b)) {
      const entry = text(why ? meta.reasons[why - 1] : "depth");
      const swatch = document.createElement("i");
      swatch.style.background = REASONS[why];
      entry.prepend(swatch);
      map.bar.append(entry);
    }
    return;
  }
  if (map.name === "camera") return;
  const strip = document.createElement("div");
  strip.className = "ramp";
  strip.style.background = ramp(map.scale);
  const digits = most - least > 20 ? 0 : most - least > 2 ? 1 : 2;
  map.bar.append(text(least.toFixed(digits)), strip, text(shown(most, digits, map.unit)));
  if (map.by) map.bar.title = "logarithmic";
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
