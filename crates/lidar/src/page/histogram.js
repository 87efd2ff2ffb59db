// The histogram under the pointer over distance, with its window, truth, guide, depth, further returns, and the fit.

// The normal distribution's share below z (Abramowitz and Stegun 7.1.26, to 1e-7).
function below(z) {
  const t = 1 / (1 + 0.3275911 * Math.abs(z) / Math.SQRT2);
  const poly = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
  const half = 0.5 * poly * Math.exp((-z * z) / 2);
  return z > 0 ? 1 - half : half;
}

// Counts of each bin by the ranging's result: background, and an echo of the pulse's width at the peak.
function fitted(edges, f, pixel) {
  const [signal, floor, peak] = [f.signal[pixel], f.background[pixel], f.peak[pixel]];
  if (!Number.isFinite(peak) || !(signal > 0)) return null;
  const share = (at) => below((at - peak) / meta.sigma_m);
  return edges.slice(1).map((end, bin) => floor + signal * (share(end) - share(edges[bin])));
}

function drawHistogram(f, pixel) {
  const plot = document.getElementById("histogram");
  const legend = document.getElementById("legend");
  legend.replaceChildren();
  const note = (words, name) => {
    const mark = document.createElement(name ? "b" : "span");
    mark.textContent = words;
    if (name) mark.style.color = colour(name);
    legend.append(mark, " ");
  };
  const edges = f.edges[pixel] ? meta.edges_m[f.edges[pixel] - 1] : null;
  const counts = f.histograms.slice(pixel * meta.bins, (pixel + 1) * meta.bins);
  if (!edges) {
    Plotly.react(plot, [], layout({ xaxis: axis("distance (m)"), yaxis: axis("counts"), annotations: [{ text: "SPADs off: no window", showarrow: false, xref: "paper", yref: "paper", x: 0.5, y: 0.5 }] }), plotting);
    return;
  }
  const [first, last] = [edges[0], edges[meta.bins]];
  const length = last - first;
  const traces = [{
    type: "scatter", mode: "lines", line: { shape: "hv", color: colour("bars"), width: 1.5 }, fill: "tozeroy", fillcolor: colour("bars") + "55",
    x: [...edges], y: [...counts, counts[meta.bins - 1]], hovertemplate: "from %{x:.2f} m: %{y}<extra></extra>",
  }];
  note("window " + first.toFixed(2) + " to " + last.toFixed(2) + " m", "bars");
  const fit = fitted(edges, f, pixel);
  if (fit) {
    const middles = fit.map((_, bin) => (edges[bin] + edges[bin + 1]) / 2);
    traces.push({ type: "scatter", mode: "lines+markers", line: { color: colour("fit"), width: 1.5, dash: "dot" }, marker: { size: 4 }, x: middles, y: fit, hovertemplate: "fit %{y:.1f}<extra></extra>" });
    note(Number.isFinite(f.depth[pixel]) ? "fit" : "fit, which makes no depth", "fit");
  }
  const most = Math.max(1, ...counts, ...(fit ?? [0])) * 1.08;
  const shapes = [{ type: "rect", xref: "x", yref: "paper", x0: first, x1: last, y0: 0, y1: 1, fillcolor: colour("bars"), opacity: 0.08, line: { width: 0 } }];
  for (const [name, value, tint, dash] of [["truth", f.truth[pixel], "truth", "solid"], ["guide", f.guide[pixel], "guide", "dash"], ["depth", f.depth[pixel], "accent", "solid"], ...further(f, pixel).map((n) => ["return " + (n + 1), f.returns[n][pixel], "accent", "dot"])]) {
    if (!Number.isFinite(value)) {
      note("no " + name);
      continue;
    }
    // What lies far away would squeeze the window to a line.
    if (value > first - 1.5 * length && value < last + 1.5 * length) {
      shapes.push({ type: "line", xref: "x", yref: "paper", x0: value, x1: value, y0: 0, y1: 1, line: { color: colour(tint), width: name === "truth" ? 4 : 2, dash } });
      note(name + " " + value.toFixed(2) + " m", tint);
    } else {
      note(name + " " + value.toFixed(2) + " m, outside of this picture", tint);
    }
  }
  const marked = shapes.map((shape) => [shape.x0, shape.x1]).flat();
  const [least, greatest] = [Math.min(...marked), Math.max(...marked)];
  const room = 0.04 * (greatest - least);
  Plotly.react(plot, traces, layout({ shapes, xaxis: axis("distance (m)", { range: [least - room, greatest + room] }), yaxis: axis("counts", { range: [0, most] }), uirevision: pixel }), plotting);
}
