// Measured points in space, one for each return: x to the right, y forward, z up. It turns.

const COLOURS = [
  { name: "depth", of: (f) => f.depth, scale: DEPTHS, range: () => meta.scale_m, unit: "m", ofReturn: (range) => range },
  { name: "error", of: (f) => f.error, scale: DIVERGING, range: errors, unit: "m" },
  { name: "confidence", of: (f) => f.confidence, scale: INFERNO, range: confidences, by: Math.log1p, unit: "" },
];

let hasCloud = true;

function pointOf(pixel, range) {
  const [row, col] = [Math.floor(pixel / meta.cols), pixel % meta.cols];
  const along = (axis, at, n) => meta.from[axis] + ((meta.to[axis] - meta.from[axis]) * (at + 0.5)) / n;
  const [x, y] = [along(0, col, meta.cols), along(1, row, meta.rows)];
  const length = Math.hypot(x, y, 1);
  return [(x * range) / length, range / length, (-y * range) / length];
}

function cloudOf(f, chosen) {
  const scaled = chosen.by ?? ((value) => value);
  const values = chosen.of(f).map(scaled);
  const cloud = { x: [], y: [], z: [], c: [], pixel: [] };
  for (let pixel = 0; pixel < pixels; pixel++) {
    for (const [n, range] of [f.depth[pixel], ...further(f, pixel).map((n) => f.returns[n][pixel])].entries()) {
      if (!Number.isFinite(range)) continue;
      const [x, y, z] = pointOf(pixel, range);
      cloud.x.push(x);
      cloud.y.push(y);
      cloud.z.push(z);
      // Error and confidence are of the depth alone.
      const value = n === 0 ? values[pixel] : chosen.ofReturn?.(range);
      cloud.c.push(Number.isFinite(value) ? value : null);
      cloud.pixel.push(pixel);
    }
  }
  return cloud;
}

function selected(f, pixel) {
  const range = [f.depth[pixel], f.truth[pixel]].find(Number.isFinite);
  const [x, y, z] = range ? pointOf(pixel, range) : [null, null, null];
  return { x: [x], y: [y], z: [z] };
}

// From behind the lidar and above it. A unit of a camera's place is the cube root of the box's volume.
function behind(cloud) {
  const extent = (values) => Math.max(1, values.reduce((a, b) => Math.max(a, b), -Infinity) - values.reduce((a, b) => Math.min(a, b), Infinity));
  const [dx, dy, dz] = [cloud.x, cloud.y, cloud.z].map((values) => (values.length ? extent(values) : 1));
  const unit = Math.cbrt(dx * dy * dz);
  return { eye: { x: -0.25, y: -dy / unit / 2 - 0.7, z: dz / unit / 2 + 0.45 }, center: { x: 0, y: -dy / unit / 4, z: -dz / unit / 4 } };
}

async function drawCloud(f, pixel, by, onPoint) {
  const plot = document.getElementById("points");
  if (!hasCloud) return;
  const chosen = COLOURS[by];
  const scaled = chosen.by ?? ((value) => value);
  const cloud = cloudOf(f, chosen);
  const [least, most] = chosen.range(f);
  const ticks = chosen.by ? [...new Set([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000].filter((n) => n >= least && n <= most))] : null;
  const space = (title) => ({ title: { text: title }, gridcolor: colour("line"), color: colour("soft"), backgroundcolor: "rgba(0,0,0,0)", showspikes: false });
  const traces = [
    {
      type: "scatter3d", mode: "markers", x: cloud.x, y: cloud.y, z: cloud.z, customdata: cloud.pixel,
      marker: { size: 2.2, color: cloud.c, colorscale: chosen.scale, cmin: scaled(least), cmax: scaled(most), colorbar: { title: { text: chosen.unit }, thickness: 10, outlinewidth: 0, ...(ticks && { tickvals: ticks.map(scaled), ticktext: ticks.map(String) }) } },
      hovertemplate: "x %{x:.1f}, y %{y:.1f}, z %{z:.1f} m<extra></extra>",
    },
    { type: "scatter3d", mode: "markers", ...selected(f, pixel), marker: { size: 7, color: colour("accent"), symbol: "diamond" }, hoverinfo: "skip" },
  ];
  const scene = {
    aspectmode: "data", xaxis: space("right (m)"), yaxis: space("forward (m)"), zaxis: space("up (m)"),
    camera: behind(cloud), uirevision: "kept",
  };
  try {
    await Plotly.react(plot, traces, layout({ scene, margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "kept" }), plotting);
  } catch (error) {
    hasCloud = false;
    plot.className = "failed";
    plot.textContent = "This browser draws nothing in space (WebGL): " + error.message;
    return;
  }
  if (!plot.dataset.listens) {
    plot.dataset.listens = "yes";
    plot.on("plotly_click", (event) => {
      const at = event.points[0]?.customdata;
      if (Number.isInteger(at)) onPoint(Math.floor(at / meta.cols), at % meta.cols);
    });
  }
}

function pointCloud(f, pixel) {
  if (!hasCloud || !document.getElementById("points").data) return;
  const { x, y, z } = selected(f, pixel);
  Plotly.restyle("points", { x: [x], y: [y], z: [z] }, [1]);
}
