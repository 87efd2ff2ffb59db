// How plotly.min.js is made, in an empty folder (Node 18):
//
//     npm install plotly.js@3.7.0 esbuild esbuild-plugin-environment esbuild-plugin-glsl esbuild-plugin-inline-css
//     node .../crates/lidar/src/page/plotly_bundle.js
//
// The packages on offer have either heatmaps or plots in space, or all of plotly in 4.8 MB. plotly.js is licensed MIT.

const { environmentPlugin } = require("esbuild-plugin-environment");
const { glsl } = require("esbuild-plugin-glsl");
const InlineCSS = require("esbuild-plugin-inline-css");

const entry = "node_modules/plotly.js/lib/index-page.js";
require("fs").writeFileSync(entry, "'use strict';\nvar Plotly = require('./core');\nPlotly.register([require('./heatmap'), require('./scatter3d')]);\nmodule.exports = Plotly;\n");
require("esbuild").build({
  entryPoints: [entry],
  outfile: "plotly.min.js",
  format: "iife",
  globalName: "Plotly",
  bundle: true,
  minify: true,
  plugins: [InlineCSS(), glsl({ minify: true }), environmentPlugin({ NODE_DEBUG: false })],
  alias: { stream: "stream-browserify" },
  define: { global: "window", "define.amd": "false" },
  target: "es2016",
  legalComments: "none",
  banner: { js: "/* plotly.js v3.7.0 (scatter, heatmap, scatter3d alone)\n\n" + require("fs").readFileSync("node_modules/plotly.js/LICENSE", "utf8").trim() + "\n*/" },
});
