// The layers, each with its switch and its opacity.
const layers = [];
let step = data.times.length - 1;
let hypothesis = null;

function addLayer(id, name, colour, on, opacity, draw, has) {
  if (has) layers.push({ id, name, colour, on, opacity, draw });
}

const anyFinding = (test) => data.robots.some((robot) => robot.findings.some((version) => test(version.what)));

/** Draws the findings in every robot's map at the current moment. */
function findings(draw) {
  return (opacity) => {
    for (const robot of data.robots) {
      const found = at(robot.findings, step);
      if (found) draw(found, robot.colour, opacity);
    }
  };
}

/** Factor by which deformations are enlarged: a round number for which the longest arrow is at most two metres. */
function enlargement() {
  let most = 0;
  for (const robot of data.robots)
    for (const version of robot.findings) for (const [, , dx, dy] of version.what.bends) most = Math.max(most, Math.hypot(dx, dy));
  return [100, 50, 20, 10, 5, 2].find((times) => times * most <= 2) || 1;
}

function makeLayers() {
  const grid = (versions, key, paint) => (opacity) => {
    const shown = at(versions, step);
    if (shown) drawGrid(shown, paintGrid(shown, key, paint()), opacity);
  };
  addLayer("merged", "Merged map", null, !data.robots.length, 1, grid(data.merged, "merged", paints.merged), data.merged.some((v) => v.what));
  for (const [index, robot] of data.robots.entries()) {
    const paint = () => paints.robot(robot.colour);
    addLayer("robot-" + index, robot.name, robot.colour, true, 0.9, grid(robot.map, "robot", paint), true);
  }
  addLayer("conflicts", "Contradictions", "#f0e442", false, 1, grid(data.conflicts, "conflict", paints.conflict), data.conflicts.some((v) => v.what && v.what.cells.some((cell) => cell > 0 && cell <= 100)));
  addLayer("segments", "Walls found", null, false, 1, findings((found, colour, opacity) => {
    for (const [x1, y1, x2, y2, reliability] of found.segments) {
      line([[x1, y1], [x2, y2]], 4.5, theme.paper, opacity * 0.8);
      line([[x1, y1], [x2, y2]], 2.5, colour, opacity * (0.25 + 0.75 * reliability));
    }
  }), anyFinding((found) => found.segments.length));
  addLayer("directions", "Directions of walls", null, false, 1, findings((found, colour, opacity) => {
    if (!found.direction) return;
    const [x, y, angle] = found.direction, length = pixels(60);
    for (const turn of [0, Math.PI / 2]) arrow([x, y], [length * Math.cos(angle + turn), length * Math.sin(angle + turn)], colour, opacity);
  }), anyFinding((found) => found.direction));
  addLayer("paths", "Paths", null, false, 1, findings((found, colour, opacity) => line(found.path, 1.5, colour, opacity)), anyFinding((found) => found.path.length > 1));
  addLayer("bends", "Deformation, " + enlargement() + " ×", null, false, 1, findings((found, colour, opacity) => {
    const times = enlargement();
    for (const [x, y, dx, dy] of found.bends) arrow([x, y], [times * dx, times * dy], colour, opacity);
  }), anyFinding((found) => found.bends.length));
  addLayer("ways", "Topological maps", null, false, 1, findings((found, colour, opacity) => {
    for (const way of found.ways) line(way, 1.5, colour, opacity);
    for (const [x, y] of found.places) dot([x, y], 7, colour, opacity);
  }), anyFinding((found) => found.places.length));
  addLayer("tags", "Tags, 2 σ", null, true, 1, findings((found, colour, opacity) => {
    for (const tag of found.tags) {
      const strength = opacity * (0.3 + 0.7 * tag.certainty);
      ellipse([tag.x, tag.y], tag.ellipse, colour, strength);
      dot([tag.x, tag.y], 5, colour, strength);
      if (camera.scale > 25) words(tag.id, [tag.x, tag.y]);
    }
  }), anyFinding((found) => found.tags.length));
}

/** The robots of the hypothesis that is shown, each with the pose of its map. */
function hypothesisMaps() {
  const named = (name) => data.robots.find((robot) => robot.name === name);
  const a = named(hypothesis.a), b = named(hypothesis.b);
  const pose = a ? a.pose : [0, 0, 0];
  const aligned = [[a, pose], [b, compose(pose, [hypothesis.x, hypothesis.y, hypothesis.yaw])]];
  return aligned.filter(([robot]) => robot && robot.own);
}

function listLayers() {
  const list = document.getElementById("layer-list");
  for (const layer of layers) {
    const row = document.createElement("div"), label = document.createElement("label");
    const box = document.createElement("input"), fade = document.createElement("input");
    row.className = "layer";
    box.type = "checkbox";
    box.checked = layer.on;
    box.id = "layer-" + layer.id;
    box.addEventListener("change", () => { layer.on = box.checked; draw(); });
    label.append(box);
    if (layer.colour) {
      const patch = document.createElement("span");
      patch.className = "patch";
      patch.style.background = layer.colour;
      label.append(patch);
    }
    label.append(layer.name);
    Object.assign(fade, { type: "range", min: 0, max: 100, value: 100 * layer.opacity, id: "fade-" + layer.id });
    fade.setAttribute("aria-label", "Opacity: " + layer.name);
    fade.addEventListener("input", () => { layer.opacity = fade.value / 100; draw(); });
    row.append(label, fade);
    list.append(row);
  }
}
