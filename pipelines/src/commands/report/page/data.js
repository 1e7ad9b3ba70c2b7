"use strict";
// The data of the log, by moment.
const data = JSON.parse(document.getElementById("data").textContent);

/** The version that is valid at a moment. */
function at(versions, step) {
  let found = null;
  for (const version of versions) if (version.from <= step) found = version.what;
  return found;
}

/** All grids in the data of a page. */
function grids(data) {
  const found = [];
  const add = (versions) => versions.forEach((version) => version.what && found.push(version.what));
  add(data.merged);
  add(data.conflicts);
  for (const robot of data.robots) {
    add(robot.map);
    if (robot.own) found.push(robot.own);
  }
  return found;
}

/** Reads the cells of a grid out of its PNG: 0 to 100, 255 unknown. */
function decode(grid) {
  return new Promise((resolve, reject) => {
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      canvas.width = grid.width;
      canvas.height = grid.height;
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      const pixels = context.getImageData(0, 0, grid.width, grid.height).data;
      grid.cells = new Uint8Array(grid.width * grid.height);
      for (let i = 0; i < grid.cells.length; i++) grid.cells[i] = pixels[4 * i];
      grid.png = null;
      resolve();
    };
    image.onerror = () => reject(new Error("a map cannot be read"));
    image.src = "data:image/png;base64," + grid.png;
  });
}

/** The value of a grid at a point of the world; null where it is unknown. */
function valueAt(grid, x, y, pose) {
  const place = pose ? inverse(pose, [x, y]) : [x, y];
  const [along, up] = inverse([grid.x, grid.y, grid.yaw], place);
  const column = Math.floor(along / grid.resolution), row = Math.floor(up / grid.resolution);
  if (column < 0 || row < 0 || column >= grid.width || row >= grid.height) return null;
  const value = grid.cells[(grid.height - 1 - row) * grid.width + column];
  return value > 100 ? null : value;
}

/** A point of the world in a frame. */
function inverse([x, y, yaw], [px, py]) {
  const dx = px - x, dy = py - y, c = Math.cos(yaw), s = Math.sin(yaw);
  return [c * dx + s * dy, -s * dx + c * dy];
}

/** The composition of two poses. */
function compose([x, y, yaw], [px, py, pyaw]) {
  const c = Math.cos(yaw), s = Math.sin(yaw);
  return [x + c * px - s * py, y + s * px + c * py, yaw + pyaw];
}
