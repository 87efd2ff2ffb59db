// What is looked at, and how keys, mouse and the address change it.

const state = { frame: 0, row: Math.floor(meta.rows / 2), col: Math.floor(meta.cols / 2), by: 0 };
const element = (id) => document.getElementById(id);
let current = null;
let playing = null;

// #r31c32f0 is a place to come back to.
function fromAddress() {
  const found = /^#r(\d+)c(\d+)f(\d+)$/.exec(location.hash);
  if (!found) return;
  const within = (n, most) => Math.min(most - 1, Number(n));
  state.row = within(found[1], meta.rows);
  state.col = within(found[2], meta.cols);
  state.frame = within(found[3], meta.times.length);
}

// A word of a shell's command line.
const quoted = (word) => (/^[\w./:=,+-]+$/.test(word) ? word : "'" + word.replaceAll("'", "'\\''") + "'");

function pointTo(row, col) {
  state.row = Math.min(meta.rows - 1, Math.max(0, row));
  state.col = Math.min(meta.cols - 1, Math.max(0, col));
  if (current) showPixel();
}

function showPixel() {
  const { row, col } = state;
  const pixel = row * meta.cols + col;
  const f = current;
  element("which").textContent = "Macropixel " + row + ", " + col;
  pointMaps(f, row, col);
  drawHistogram(f, pixel);
  pointCloud(f, pixel);
  const total = f.histograms.subarray(pixel * meta.bins, (pixel + 1) * meta.bins).reduce((a, b) => a + b, 0);
  const numbers = [
    ["sees", meta.objects[f.object[pixel] - 1] ?? "sky"],
    ["truth", shown(f.truth[pixel], 3, "m") + (f.inWindow[pixel] ? ", in window" : "")],
    ["guide", shown(f.guide[pixel], 3, "m")],
    ["start value", f.start[pixel] < 0 ? "none, SPADs off" : f.start[pixel]],
    ["depth", shown(f.depth[pixel], 3, "m")],
    ["bound of the counts", shown(1e3 * f.bound[pixel], 1, "mm")],
    ["spread of depths within", shown(1e3 * f.spread[pixel], 1, "mm")],
    ["further returns", further(f, pixel).map((n) => returnOf(f, pixel, n)).join("; ") || "–"],
    ["error", shown(1e3 * f.error[pixel], 1, "mm")],
    ["result", reasonOf(f, pixel)],
    ["confidence, −log₁₀ of a false alarm", shown(f.confidence[pixel], 1)],
    ["counts, all bins", total],
    ["signal above background", shown(f.signal[pixel], 1) + " over " + shown(f.background[pixel], 1) + " a bin"],
  ];
  element("numbers").replaceChildren(...numbers.map(([name, value]) => {
    const line = document.createElement("tr");
    for (const text of [name, value]) line.insertCell().textContent = text;
    return line;
  }));
  showCommand(row, col);
  history.replaceState(null, "", "#r" + row + "c" + col + "f" + state.frame);
}

const returnOf = (f, pixel, n) => shown(f.returns[n][pixel], 3, "m") + " (bound " + shown(1e3 * f.returnBounds[n][pixel], 1, "mm") + ", " + f.returnPhotons[n][pixel].toPrecision(2) + " photons a laser cycle)";

function showCommand(row, col) {
  const folder = meta.folder.replace(/\/$/, "");
  const has = meta.probes.some(([r, c]) => r === row && c === col);
  if (meta.is_drive) {
    element("wave").textContent = "Drives keep no photons. A single frame of the world at its beginning, with this macropixel's waveform:";
    const exposure = " --stop-periods " + meta.stop_periods + " --laser-cycles " + meta.laser_cycles + " --seed " + meta.seed;
    element("command").textContent = "gdtof frame --scene " + quoted(meta.scene) + exposure + " --probe " + row + "," + col + " --out " + quoted(folder + "_frame");
  } else if (has) {
    element("wave").textContent = "Its waveform is there:";
    element("command").textContent = "gtkwave " + quoted(folder + "/probe_r" + row + "_c" + col + ".gtkw");
  } else {
    element("wave").textContent = "A waveform of one of its laser cycles (0 to " + (meta.laser_cycles - 1) + "):";
    element("command").textContent = "gdtof wave --frame " + quoted(folder + "/frame.json") + " --pixel " + row + "," + col + " --cycle " + Math.min(1, meta.laser_cycles - 1);
  }
}

async function showFrame(number) {
  state.frame = (number + meta.times.length) % meta.times.length;
  const wanted = state.frame;
  const f = await frameAt(wanted);
  if (wanted !== state.frame) return;
  current = f;
  const { summary, time_s } = meta.times[wanted];
  const facts = [summary.depths + " depths of " + summary.with_target + " surfaces", summary.outliers + " outliers",
    "RMS without them " + shown(1e3 * (summary.rms_error_without_outliers_m ?? NaN), 0, "mm"), "median " + shown(1e3 * (summary.median_absolute_error_m ?? NaN), 0, "mm")];
  element("facts").textContent = facts.join(" · ");
  element("time").value = wanted;
  element("when").textContent = "frame " + meta.times[wanted].number + ", " + time_s.toFixed(3) + " s";
  drawMaps(f);
  await drawCloud(f, state.row * meta.cols + state.col, state.by, pointTo);
  showPixel();
  drawTrend();
}

// Depths found and their error over the drive.
function drawTrend() {
  if (meta.times.length < 2) return;
  const x = meta.times.map((_, at) => at);
  const of = (name, factor) => meta.times.map(({ summary }) => (summary[name] ?? NaN) * factor);
  const line = (y, name, yaxis, tint) => ({ type: "scatter", mode: "lines", x, y, yaxis, line: { color: colour(tint), width: 1.5 }, hovertemplate: name + " %{y:.0f}<extra></extra>" });
  const shapes = [{ type: "line", xref: "x", yref: "paper", x0: state.frame, x1: state.frame, y0: 0, y1: 1, line: { color: colour("accent"), width: 2 } }];
  const side = (title, tint, more) => axis(title, { color: colour(tint), fixedrange: true, nticks: 4, rangemode: "tozero", ...more });
  Plotly.react("trend", [line(of("depths", 1), "depths", "y", "bars"), line(of("median_absolute_error_m", 1e3), "median error, mm", "y2", "fit")],
    layout({ margin: { l: 46, r: 46, t: 4, b: 16 }, shapes, xaxis: axis("", { fixedrange: true, range: [-0.5, meta.times.length - 0.5], showticklabels: false }), yaxis: side("", "bars"), yaxis2: side("", "fit", { overlaying: "y", side: "right", showgrid: false }) }), plotting);
}

function play() {
  if (playing) {
    clearInterval(playing);
    playing = null;
  } else if (meta.times.length > 1) {
    let busy = false;
    playing = setInterval(async () => {
      if (busy) return;
      busy = true;
      await showFrame(state.frame + 1);
      busy = false;
    }, 150);
  }
  element("play").textContent = playing ? "Stop" : "Play";
}

function toggleTheme() {
  chosen = root.dataset.theme === "dark" ? "light" : "dark";
  applyTheme();
  return showFrame(state.frame);
}

function colourBy(by) {
  state.by = by % COLOURS.length;
  element("colour").value = state.by;
  return drawCloud(current, state.row * meta.cols + state.col, state.by, pointTo);
}

function onKey(event) {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const typed = event.target.closest?.("select, input");
  const moves = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
  const far = event.shiftKey ? 8 : 1;
  if (moves[event.key] && !typed) {
    pointTo(state.row + far * moves[event.key][0], state.col + far * moves[event.key][1]);
  } else if (event.key === ",") {
    showFrame(state.frame - 1);
  } else if (event.key === ".") {
    showFrame(state.frame + 1);
  } else if (event.key === " " && !event.target.closest?.("button, summary, select")) {
    play();
  } else if (event.key.toLowerCase() === "t" && !typed) {
    toggleTheme();
  } else if (event.key.toLowerCase() === "c" && !typed) {
    colourBy(state.by + 1);
  } else if (event.key === "?") {
    element("help").open = !element("help").open;
  } else {
    return;
  }
  event.preventDefault();
}

async function begin() {
  fromAddress();
  applyTheme();
  dark.addEventListener("change", () => {
    if (!chosen) {
      applyTheme();
      showFrame(state.frame);
    }
  });
  makeMaps(element("maps"), pointTo);
  new ResizeObserver(() => requestAnimationFrame(() => {
    if (current && !areMapsSharp()) drawMaps(current);
  })).observe(element("maps"));
  element("colour").append(...COLOURS.map((by, at) => new Option("by " + by.name, at)));
  element("colour").addEventListener("change", (event) => colourBy(Number(event.target.value)));
  element("theme").addEventListener("click", toggleTheme);
  element("copy").addEventListener("click", () => navigator.clipboard?.writeText(element("command").textContent));
  element("timeline").hidden = meta.times.length < 2;
  element("time").max = meta.times.length - 1;
  element("time").addEventListener("input", (event) => showFrame(Number(event.target.value)));
  element("play").addEventListener("click", play);
  document.addEventListener("keydown", onKey);
  await showFrame(state.frame);
  element("trend").on?.("plotly_click", (event) => showFrame(event.points[0].x));
  root.dataset.ready = "yes";
}

begin();
