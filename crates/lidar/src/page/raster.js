// Cells in colours and patterns on a canvas that fills its box, pixel by pixel of the screen.

// Levels of red, green and blue at a place of a scale, 0 to 1; beyond, those of the end.
const scales = new Map();
function shade(scale, place) {
  if (!Number.isFinite(place)) return null;
  if (!scales.has(scale)) {
    scales.set(scale, scale.map(([at, hex]) => [at, [1, 3, 5].map((digit) => parseInt(hex.slice(digit, digit + 2), 16))]));
  }
  const stops = scales.get(scale);
  const along = Math.min(1, Math.max(0, place));
  const after = Math.max(1, stops.findIndex(([at]) => at >= along));
  const [[from, near], [to, far]] = [stops[after - 1], stops[after]];
  return near.map((level, channel) => Math.round(level + ((along - from) / (to - from)) * (far[channel] - level)));
}

// Pixels of the screen for one pixel of a tile, which keeps its size on fine screens.
const fineness = () => Math.max(1, Math.round(window.devicePixelRatio || 1));

// Width and height of an element, pixels of the screen.
const screenSize = (box) => [box.clientWidth, box.clientHeight].map((size) => Math.round(size * (window.devicePixelRatio || 1)));

// Paints rows x cols cells. colourAt gives a cell's colour, null for none; patternAt its pattern, which goes before.
function paint(canvas, [rows, cols], colourAt, patternAt) {
  const box = canvas.parentElement;
  const [width, height] = screenSize(box);
  if (!width || !height) return;
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const fine = fineness();
  const isTiled = width / cols / fine >= meta.smallest_tiled_px;
  const cellsAlong = (length, cells) => Array.from({ length }, (_, at) => Math.floor((at * cells) / length));
  const [cellX, cellY] = [cellsAlong(width, cols), cellsAlong(height, rows)];
  const looks = Array.from({ length: rows * cols }, (_, cell) => patternAt(cell) || colourAt(cell));
  let at = 0;
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++, at += 4) {
      const look = looks[cellY[y] * cols + cellX[x]];
      if (!look) continue;
      if (look.levels) {
        const level = isTiled ? look.levels[Math.floor(y / fine) % 4][Math.floor(x / fine) % 4] : look.mean;
        image.data.fill(level, at, at + 3);
      } else {
        image.data.set(look, at);
      }
      image.data[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
}

// Paints a pattern's tiles for a legend.
function paintSample(canvas, pattern) {
  const [fine, side] = [fineness(), 12];
  canvas.width = canvas.height = side * fine;
  const context = canvas.getContext("2d");
  for (let y = 0; y < side; y++) {
    for (let x = 0; x < side; x++) {
      const level = pattern.levels[y % 4][x % 4];
      context.fillStyle = "rgb(" + level + "," + level + "," + level + ")";
      context.fillRect(x * fine, y * fine, fine, fine);
    }
  }
}
