// Colours of both themes, and what plots have in common.

const root = document.documentElement;
const dark = window.matchMedia("(prefers-color-scheme: dark)");
let chosen = null;

const colour = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();

function applyTheme() {
  root.dataset.theme = chosen ?? (dark.matches ? "dark" : "light");
}

function layout(more) {
  return {
    margin: { l: 46, r: 8, t: 6, b: 36 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: colour("ink"), size: 11, family: "system-ui, sans-serif" },
    showlegend: false,
    ...more,
  };
}

function axis(title, more) {
  return { title: { text: title, standoff: 6 }, gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("soft"), ...more };
}

const plotting = { displayModeBar: false, responsive: true };

const INFERNO = [[0, "#1b0c41"], [0.3, "#781c6d"], [0.6, "#ed6925"], [1, "#fcffa4"]];
const DIVERGING = [[0, "#2166ac"], [0.5, "#f2f2f2"], [1, "#b2182b"]];
const GREYS = [[0, "#000000"], [1, "#ffffff"]];
// Those of depth.png, from near to far.
const DEPTHS = meta.depth_colours.map((rgb, at, all) => [at / (all.length - 1), "#" + rgb.map((c) => c.toString(16).padStart(2, "0")).join("")]);

const ramp = (scale) => "linear-gradient(90deg," + scale.map(([at, c]) => c + " " + 100 * at + "%").join(",") + ")";
