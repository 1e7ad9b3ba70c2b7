// Drawing on the canvas, in metres.
const canvas = document.getElementById("map");
const context = canvas.getContext("2d");
const camera = { x: 0, y: 0, scale: 20 };
let theme = {};

function readTheme() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["paper", "ink", "unknown", "free", "wall"]) theme[name] = style.getPropertyValue("--" + name).trim();
}

function rgb(hex) {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
}

/** Paints the cells of a grid on a canvas: `paint` gives red, green, blue and opacity of a value. */
function paintGrid(grid, key, paint) {
  grid.painted = grid.painted || {};
  if (grid.painted[key]) return grid.painted[key];
  const made = document.createElement("canvas");
  made.width = grid.width;
  made.height = grid.height;
  const context = made.getContext("2d");
  const image = context.createImageData(grid.width, grid.height);
  const colours = Array.from({ length: 256 }, (_, value) => (value > 100 ? [0, 0, 0, 0] : paint(value)));
  grid.cells.forEach((value, i) => image.data.set(colours[value], 4 * i));
  context.putImageData(image, 0, 0);
  return (grid.painted[key] = made);
}

const paints = {
  merged: () => {
    const free = rgb(theme.free), wall = rgb(theme.wall);
    return (value) => [...free.map((part, i) => part + (wall[i] - part) * value / 100), 255];
  },
  robot: (colour) => {
    const own = rgb(colour);
    return (value) => (value >= 65 ? [...own, 255] : [...own, value < 25 ? 45 : 110]);
  },
  conflict: () => (value) => [240, 228, 66, value < 1 ? 0 : 80 + 1.75 * value],
};

function drawGrid(grid, painted, opacity, pose) {
  const [x, y, yaw] = compose(pose || [0, 0, 0], [grid.x, grid.y, grid.yaw]);
  const c = Math.cos(yaw) * grid.resolution, s = Math.sin(yaw) * grid.resolution, rows = grid.height;
  context.save();
  context.globalAlpha = opacity;
  context.imageSmoothingEnabled = grid.resolution * camera.scale * ratio() < 1;
  context.transform(c, s, s, -c, x - s * rows, y + c * rows);
  context.drawImage(painted, 0, 0);
  context.restore();
}

function ratio() {
  return window.devicePixelRatio || 1;
}

/** Sets the transform so that lengths are metres of the world, y up. */
function toWorld() {
  const scale = camera.scale * ratio();
  context.setTransform(scale, 0, 0, -scale, canvas.width / 2 - camera.x * scale, canvas.height / 2 + camera.y * scale);
}

/** The point of the world at a pixel of the canvas. */
function worldOf(u, v) {
  return [camera.x + (u - canvas.clientWidth / 2) / camera.scale, camera.y - (v - canvas.clientHeight / 2) / camera.scale];
}

/** A length in pixels of the page, in metres. */
function pixels(count) {
  return count / camera.scale;
}

function line(points, width, colour, opacity) {
  if (points.length < 2) return;
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  stroke(width, colour, opacity);
}

function stroke(width, colour, opacity) {
  context.lineWidth = pixels(width);
  context.strokeStyle = colour;
  context.globalAlpha = opacity;
  context.lineCap = context.lineJoin = "round";
  context.stroke();
}

function dot([x, y], width, colour, opacity) {
  context.beginPath();
  context.arc(x, y, pixels(width / 2), 0, 7);
  context.fillStyle = colour;
  context.globalAlpha = opacity;
  context.fill();
}

function arrow([x, y], [dx, dy], colour, opacity) {
  const length = Math.hypot(dx, dy), head = Math.min(pixels(7), 0.6 * length);
  if (!(length > 0)) return;
  const ux = dx / length, uy = dy / length, tip = [x + dx, y + dy];
  const barb = (side) => [tip[0] - head * (ux + side * 0.5 * uy), tip[1] - head * (uy - side * 0.5 * ux)];
  line([[x, y], tip], 1.4, colour, opacity);
  line([barb(1), tip, barb(-1)], 1.4, colour, opacity);
}

function ellipse([x, y], [first, second, angle], colour, opacity) {
  context.beginPath();
  context.ellipse(x, y, first, second, angle, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.globalAlpha = 0.15 * opacity;
  context.fill();
  stroke(1.5, colour, opacity);
}

/** Draws text beside a point, with a pale outline. */
function words(text, [x, y]) {
  const scale = ratio();
  const u = canvas.width / 2 + (x - camera.x) * camera.scale * scale, v = canvas.height / 2 - (y - camera.y) * camera.scale * scale;
  context.save();
  context.setTransform(1, 0, 0, 1, u + 6 * scale, v - 5 * scale);
  context.font = 12 * scale + "px system-ui, sans-serif";
  context.globalAlpha = 0.85;
  context.lineWidth = 3 * scale;
  context.lineJoin = "round";
  context.strokeStyle = theme.paper;
  context.strokeText(text, 0, 0);
  context.globalAlpha = 1;
  context.fillStyle = theme.ink;
  context.fillText(text, 0, 0);
  context.restore();
}

/** Draws a scale bar of a round length. */
function scaleBar() {
  const limit = canvas.clientWidth / 4 / camera.scale, power = 10 ** Math.floor(Math.log10(limit));
  const metres = [5, 2, 1].find((n) => n * power <= limit) * power, scale = ratio();
  context.setTransform(scale, 0, 0, scale, 12 * scale, canvas.height - 12 * scale);
  context.globalAlpha = 0.85;
  context.fillStyle = theme.paper;
  context.fillRect(-6, -26, metres * camera.scale + 12, 32);
  context.globalAlpha = 1;
  context.fillStyle = theme.ink;
  context.fillRect(0, -5, metres * camera.scale, 5);
  context.font = "13px system-ui, sans-serif";
  context.fillText(Number(metres.toPrecision(2)) + " m", 0, -10);
}
