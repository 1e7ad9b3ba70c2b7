// Follows a live run: its changes replace what is shown, and the view stays as the user has set it.
function follow() {
  // A live page has only one moment, the last.
  document.getElementById("time").style.display = "none";
  const status = document.getElementById("live"), source = new EventSource("live");
  let taken = Promise.resolve();
  source.addEventListener("change", (event) => {
    taken = taken.then(() => show(JSON.parse(event.data))).then(() => { status.textContent = "The run goes on."; });
  });
  source.addEventListener("end", () => {
    source.close();
    taken.then(() => { status.textContent = "The run has ended. This is its final state."; });
  });
  source.onerror = () => { status.textContent = "The connection to the run is lost. Reconnecting."; };
}

async function show({ headline, findings, data: next }) {
  await Promise.all(grids(next).map(decode));
  const isFirst = !grids(data).length;
  const kept = new Map(layers.map((layer) => [layer.id, layer]));
  const before = hypothesis;
  Object.assign(data, next);
  step = data.times.length - 1;
  layers.length = 0;
  makeLayers();
  for (const layer of layers) {
    const { on, opacity } = kept.get(layer.id) || layer;
    // Before the first map the user cannot have chosen layers.
    if (!isFirst) Object.assign(layer, { on, opacity });
  }
  document.getElementById("layer-list").replaceChildren();
  listLayers();
  replace("headline", headline);
  if (replace("findings", findings)) listenToHypotheses();
  const place = before && data.hypotheses.findIndex((one) => ["topic", "a", "b", "rank"].every((key) => one[key] === before[key]));
  if (before && place < 0) showHypothesis(null);
  else if (before) {
    hypothesis = data.hypotheses[place];
    document.querySelector(`[data-hypothesis="${place}"]`).setAttribute("aria-pressed", "true");
  }
  showMoment(step);
  if (!isMoved) fit();
}

const written = {};

/** Sets the markup of an element if it has changed. Returns whether it has. */
function replace(id, markup) {
  if (written[id] === markup) return false;
  written[id] = markup;
  document.getElementById(id).innerHTML = markup;
  return true;
}
