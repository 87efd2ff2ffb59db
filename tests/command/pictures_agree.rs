//! `depth.png` and the page show the same: the colour of every depth, the pattern of every reason, and the legend.
//!
//! Python's `test_views.py` holds its plots to `depth.png` in the same way.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::a_page_shows_a_frame::seen_in_a_browser;
use super::tools::gdtof_words;

/// Macropixels of a row and a column.
const SIDE: usize = 16;

/// Pixels of a macropixel's side in depth.png, and where the map begins there: within a margin and below a title.
const CELL_PX: usize = 512 / SIDE;
const LEFT_PX: usize = 12;
const TOP_PX: usize = 40;

/// Put last: leaves the colours of every cell of the depth map, and its legend.
const LOOKS: &str = r##"<script>
(async () => {
  const root = document.documentElement;
  for (let i = 0; i < 400 && !root.dataset.ready; i++) await new Promise((go) => setTimeout(go, 50));
  const canvas = document.querySelector("#map-depth canvas");
  const { width, height, data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const cells = Array.from({ length: 256 }, () => new Set());
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const cell = Math.floor((y * 16) / height) * 16 + Math.floor((x * 16) / width);
      cells[cell].add([...data.slice(4 * (y * width + x), 4 * (y * width + x) + 3)].join(" "));
    }
  }
  const box = document.getElementById("map-depth");
  const saw = {
    ready: root.dataset.ready,
    cells: cells.map((colours) => [...colours]),
    fills: [canvas.clientWidth === box.clientWidth, canvas.clientHeight === box.clientHeight],
    legend: [...document.querySelectorAll(".reasons span")].map((entry) => entry.textContent),
    bad,
  };
  const result = document.createElement("pre");
  result.textContent = "SAW:" + encodeURIComponent(JSON.stringify(saw)) + ":";
  document.body.replaceChildren(result);
})();
</script>"##;

/// The colours of every cell of the map in depth.png.
fn drawn(path: &Path) -> Vec<BTreeSet<[u8; 3]>> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let width = reader.next_frame(&mut bytes).unwrap().width as usize;
    let pixel = |x: usize, y: usize| {
        let at = 3 * ((TOP_PX + y) * width + LEFT_PX + x);
        [bytes[at], bytes[at + 1], bytes[at + 2]]
    };
    let colours = |cell: usize| {
        let (left, top) = (cell % SIDE * CELL_PX, cell / SIDE * CELL_PX);
        let pixels =
            (0..CELL_PX * CELL_PX).map(|at| pixel(left + at % CELL_PX, top + at / CELL_PX));
        pixels.collect()
    };
    (0..SIDE * SIDE).map(colours).collect()
}

/// Colours as the script writes them.
fn shown(cell: &Value) -> BTreeSet<[u8; 3]> {
    let colours = cell.as_array().unwrap().iter();
    let levels = |colour: &Value| -> Vec<u8> {
        let text = colour.as_str().unwrap();
        text.split(' ')
            .map(|level| level.parse().unwrap())
            .collect()
    };
    colours
        .map(|colour| levels(colour).try_into().unwrap())
        .collect()
}

#[test]
fn depth_png_and_the_page_have_the_same_colours_patterns_and_legend() {
    let dir = tempfile::tempdir().unwrap();
    let frame = "frame --rows 16 --cols 16 --laser-cycles 200 --probe none --page --json";
    let done = gdtof_words(dir.path(), frame);
    assert!(done.status.success(), "{done:?}");
    let frame: Value = serde_json::from_slice(&done.stdout).unwrap();
    let page = std::fs::read_to_string(dir.path().join("out/page.html")).unwrap();
    let Some(saw) = seen_in_a_browser(&page, LOOKS) else {
        return;
    };
    assert_eq!(saw["fills"], serde_json::json!([true, true]));
    let macropixels = frame["macropixels"].as_array().unwrap();
    let drawn = drawn(&dir.path().join("out/depth.png"));
    let (mut depths, mut reasons) = (0, BTreeSet::new());
    for (number, macropixel) in macropixels.iter().enumerate() {
        let (drawn, shown) = (&drawn[number], shown(&saw["cells"][number]));
        if let Some(reason) = macropixel["no_depth"].as_str() {
            assert_eq!(*drawn, shown, "{reason}");
            assert!(
                drawn
                    .iter()
                    .all(|rgb| rgb.iter().all(|level| *level == rgb[0]))
            );
            reasons.insert(reason);
        } else {
            // depth.png has 224 colours, the page all between its stops.
            let (one, other) = (drawn.first().unwrap(), shown.first().unwrap());
            let apart = one.iter().zip(other).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(apart < Some(4), "{one:?} {other:?}");
            assert_eq!((drawn.len(), shown.len()), (1, 1));
            depths += 1;
        }
    }
    assert!(depths > 10 && reasons.len() >= 3, "{depths} {reasons:?}");
    let counted: usize = (saw["legend"].as_array().unwrap().iter())
        .map(|entry| {
            let count = entry.as_str().unwrap().rsplit(' ').next().unwrap();
            count.parse::<usize>().unwrap()
        })
        .sum();
    assert_eq!(saw["legend"].as_array().unwrap().len(), reasons.len());
    assert_eq!(counted + depths, macropixels.len());
}
