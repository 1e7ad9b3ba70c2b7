// The page: navigation, the slider, hypotheses, and the values under the pointer.
function draw() {
  const width = Math.round(canvas.clientWidth * ratio()), height = Math.round(canvas.clientHeight * ratio());
  if (!width || !height) return;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.globalAlpha = 1;
  context.fillStyle = theme.unknown;
  context.fillRect(0, 0, width, height);
  toWorld();
  if (hypothesis) {
    for (const [robot, pose] of hypothesisMaps()) drawGrid(robot.own, paintGrid(robot.own, "robot", paints.robot(robot.colour)), 0.9, pose);
  } else {
    for (const layer of layers) if (layer.on && layer.opacity > 0) { layer.draw(layer.opacity); toWorld(); }
  }
  scaleBar();
}

/** Whether the user has moved the map since all of it was shown. */
let isMoved = false;

/** Shows all maps of the moment. */
function fit() {
  isMoved = false;
  let box = [Infinity, Infinity, -Infinity, -Infinity];
  const add = (grid, pose) => {
    const corner = compose(pose || [0, 0, 0], [grid.x, grid.y, grid.yaw]);
    for (const [u, v] of [[0, 0], [1, 0], [0, 1], [1, 1]]) {
      const [x, y] = compose(corner, [u * grid.width * grid.resolution, v * grid.height * grid.resolution, 0]);
      box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x), Math.max(box[3], y)];
    }
  };
  if (hypothesis) hypothesisMaps().forEach(([robot, pose]) => add(robot.own, pose));
  else [data.merged, ...data.robots.map((robot) => robot.map)].forEach((versions) => { const grid = at(versions, step); if (grid) add(grid); });
  if (!(box[2] > box[0] && canvas.clientWidth)) return;
  camera.x = (box[0] + box[2]) / 2;
  camera.y = (box[1] + box[3]) / 2;
  camera.scale = 0.94 * Math.min(canvas.clientWidth / (box[2] - box[0]), canvas.clientHeight / (box[3] - box[1]));
  draw();
}

function zoom(factor, u = canvas.clientWidth / 2, v = canvas.clientHeight / 2) {
  const [x, y] = worldOf(u, v);
  camera.scale = Math.min(5000, Math.max(0.05, camera.scale * factor));
  const [nx, ny] = worldOf(u, v);
  camera.x += x - nx;
  camera.y += y - ny;
  isMoved = true;
  draw();
}

function move(u, v) {
  camera.x -= u / camera.scale;
  camera.y += v / camera.scale;
  isMoved = true;
  draw();
}

function showMoment(next) {
  step = next;
  document.getElementById("moment").textContent = data.times[step].toFixed(1) + " s (" + (step + 1) + " of " + data.times.length + ")";
  draw();
}

function showHypothesis(index) {
  hypothesis = index === null ? null : data.hypotheses[index];
  for (const button of document.querySelectorAll(".show")) button.setAttribute("aria-pressed", String(button.dataset.hypothesis === String(index)));
  document.getElementById("banner").hidden = !hypothesis;
  if (hypothesis) {
    const { a, b, rank, topic, accepted } = hypothesis;
    document.getElementById("banner-text").textContent = a + " and " + b + " by hypothesis no. " + (rank + 1) + " on " + topic + (accepted ? ", accepted." : ", refused.");
    canvas.scrollIntoView({ block: "nearest" });
  }
  fit();
}

/** Shows the values at the place under the pointer. */
function showValues(u, v) {
  const [x, y] = worldOf(u, v), lines = [x.toFixed(2) + ", " + y.toFixed(2) + " m"];
  const add = (name, value) => { if (value !== null) lines.push(name + ": " + value + " % occupied"); };
  if (hypothesis) {
    for (const [robot, pose] of hypothesisMaps()) add(robot.name, valueAt(robot.own, x, y, pose));
  } else {
    const value = (versions) => { const grid = at(versions, step); return grid ? valueAt(grid, x, y) : null; };
    add("merged", value(data.merged));
    for (const robot of data.robots) add(robot.name, value(robot.map));
    const conflict = value(data.conflicts);
    if (conflict) lines.push("contradiction: " + conflict + " %");
    lines.push(...nearby(x, y));
  }
  document.getElementById("hover").textContent = lines.join("\n");
}

/** Tags and walls near a place, of the layers that are on. */
function nearby(x, y) {
  const isOn = (id) => layers.some((layer) => layer.id === id && layer.on), reach = pixels(8), lines = [];
  for (const robot of data.robots) {
    const found = at(robot.findings, step);
    if (!found) continue;
    if (isOn("tags")) for (const tag of found.tags) {
      if (Math.hypot(tag.x - x, tag.y - y) > reach) continue;
      const [first, second] = tag.ellipse;
      lines.push(robot.name + ": tag " + tag.id + ", certainty " + tag.certainty.toFixed(2) + ", " + tag.readings + " readings, 2 σ " + first.toFixed(2) + " and " + second.toFixed(2) + " m");
    }
    if (isOn("segments")) for (const [x1, y1, x2, y2, reliability, inliers] of found.segments) {
      const length = Math.hypot(x2 - x1, y2 - y1), share = Math.max(0, Math.min(1, ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / (length * length || 1)));
      if (Math.hypot(x1 + share * (x2 - x1) - x, y1 + share * (y2 - y1) - y) > reach) continue;
      lines.push(robot.name + ": wall of " + length.toFixed(2) + " m, reliability " + reliability.toFixed(2) + ", " + inliers + " cells");
    }
    if (isOn("bends")) for (const [bx, by, dx, dy, turn] of found.bends) {
      if (Math.hypot(bx - x, by - y) > reach) continue;
      lines.push(robot.name + ": deformed by " + Math.hypot(dx, dy).toFixed(3) + " m and " + (turn * 180 / Math.PI).toFixed(2) + "°");
    }
  }
  return lines.slice(0, 6);
}

function listenToHypotheses() {
  for (const button of document.querySelectorAll(".show")) {
    button.addEventListener("click", () => showHypothesis(button.getAttribute("aria-pressed") === "true" ? null : Number(button.dataset.hypothesis)));
  }
}

function listen() {
  const slider = document.getElementById("slider"), pointers = new Map();
  slider.max = data.times.length - 1;
  slider.value = step;
  slider.addEventListener("input", () => showMoment(Number(slider.value)));
  document.getElementById("in").addEventListener("click", () => zoom(1.4));
  document.getElementById("out").addEventListener("click", () => zoom(1 / 1.4));
  document.getElementById("fit").addEventListener("click", fit);
  document.getElementById("back").addEventListener("click", () => showHypothesis(null));
  listenToHypotheses();
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY);
  }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
  });
  canvas.addEventListener("pointermove", (event) => {
    showValues(event.offsetX, event.offsetY);
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const others = [...pointers.values()].filter((other) => other.pointerId !== event.pointerId);
    const distance = (one) => Math.hypot(one.offsetX - others[0].offsetX, one.offsetY - others[0].offsetY);
    if (others.length) zoom(distance(event) / Math.max(1, distance(before)), (event.offsetX + others[0].offsetX) / 2, (event.offsetY + others[0].offsetY) / 2);
    else move(event.offsetX - before.offsetX, event.offsetY - before.offsetY);
    pointers.set(event.pointerId, event);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => { document.getElementById("hover").textContent = ""; });
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] }[event.key];
    if (by) move(...by);
    else if (event.key === "+" || event.key === "=") zoom(1.4);
    else if (event.key === "-") zoom(1 / 1.4);
    else if (event.key === "0") fit();
    else return;
    event.preventDefault();
  });
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  for (const end of ["beforeprint", "afterprint"]) addEventListener(end, repaint);
}

/** Reads the colours again and redraws. */
function repaint() {
  readTheme();
  for (const grid of grids(data)) grid.painted = {};
  draw();
}

async function start() {
  readTheme();
  await Promise.all(grids(data).map(decode));
  makeLayers();
  listLayers();
  listen();
  showMoment(step);
  fit();
  document.documentElement.dataset.ready = "true";
  if (typeof follow === "function") follow();
}

start();
