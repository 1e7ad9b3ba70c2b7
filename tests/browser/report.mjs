// Opens reports in a headless Chromium and uses them: layers, slider, hypotheses, keys, hovering, dark and light, wide and on a
// phone. Fails on whatever the console says and on what does not change the picture. Needs Node and Chromium, nothing else.
//
//     node tests/browser/report.mjs REPORT.html... [--pictures FOLDER]
import { writeFileSync } from "node:fs";
import { basename, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { check, evaluate, open as openPage, picture, run, send, shown } from "./chromium.mjs";

const open = (file, ...how) => openPage(pathToFileURL(resolve(file)).href, ...how);
async function changes(what, expression) {
  const before = await shown();
  await evaluate(expression);
  check(what + " changes the map", (await shown()) !== before);
}
async function use(file, folder) {
  const name = basename(file, ".html");
  for (const [kind, width, height] of [["wide", 1280, 900], ["phone", 390, 844]]) {
    for (const scheme of ["light", "dark"]) {
      await open(file, width, height, scheme);
      check(`${name} ${kind} fits its width`, await evaluate("document.documentElement.scrollWidth <= innerWidth"));
      await picture(folder, `${name}-${kind}-${scheme}`, kind === "wide" && scheme === "light");
    }
  }
  await open(file, 1280, 900, "light");
  const layers = await evaluate("layers.map(({ id, on }) => [id, on])");
  check(name + " has layers", layers.length > 0);
  // One by one, each against nothing.
  await evaluate("layers.forEach(({ id, on }) => { if (on) document.getElementById('layer-' + id).click(); })");
  for (const [id] of layers) {
    const click = `document.getElementById(${JSON.stringify("layer-" + id)}).click()`;
    await changes(name + ": layer " + id, click);
    const fade = `{ const fade = document.getElementById(${JSON.stringify("fade-" + id)}); fade.value = 30; fade.dispatchEvent(new Event("input")); }`;
    await changes(name + ": fading " + id, fade);
    await evaluate(click);
  }
  await evaluate(`layers.forEach(({ id, on }) => { document.getElementById("layer-" + id).click(); const fade = document.getElementById("fade-" + id); fade.value = 100; fade.dispatchEvent(new Event("input")); })`);
  await picture(folder, name + "-all-layers", false);
  const moments = await evaluate("data.times.length");
  if (moments > 1) {
    await changes(name + ": the slider", `{ const slider = document.getElementById("slider"); slider.value = 0; slider.dispatchEvent(new Event("input")); }`);
    check(name + " tells the moment", (await evaluate("document.getElementById('moment').textContent")).includes("(1 of " + moments + ")"));
    await picture(folder, name + "-first-moment", false);
    await evaluate("showMoment(data.times.length - 1)");
  }
  const key = (key) => `canvas.dispatchEvent(new KeyboardEvent("keydown", { key: ${JSON.stringify(key)} }))`;
  for (const one of ["ArrowLeft", "ArrowUp", "+", "-", "0"]) await changes(name + ": the key " + one, key(one));
  const { x, y } = await evaluate("(() => { const { x, y, width, height } = canvas.getBoundingClientRect(); return { x: x + width / 2, y: y + height / 2 }; })()");
  await send("Input.dispatchMouseEvent", { type: "mouseMoved", x, y });
  check(name + " tells the place under the pointer", (await evaluate("document.getElementById('hover').textContent")).includes(" m"));
  const before = await shown();
  await send("Input.dispatchMouseEvent", { type: "mouseWheel", x, y, deltaX: 0, deltaY: -240 });
  await send("Input.dispatchMouseEvent", { type: "mousePressed", x, y, button: "left", clickCount: 1 });
  await send("Input.dispatchMouseEvent", { type: "mouseMoved", x: x + 60, y: y + 30, button: "left", buttons: 1 });
  await send("Input.dispatchMouseEvent", { type: "mouseReleased", x: x + 60, y: y + 30, button: "left", clickCount: 1 });
  check(name + ": wheel and dragging change the map", (await shown()) !== before);
  for (const index of await evaluate("data.hypotheses.map((one, i) => i).slice(-2)")) {
    await changes(`${name}: hypothesis ${index}`, `document.querySelector('[data-hypothesis="${index}"]').click()`);
    check(name + " says which hypothesis is shown", !(await evaluate("document.getElementById('banner').hidden")));
    await picture(folder, `${name}-hypothesis-${index}`, false);
    await changes(name + ": back to the merge", "document.getElementById('back').click()");
  }
  check(name + ": every control has a name and can be reached by keys", await evaluate(`[...document.querySelectorAll("button, input")]
    .every((one) => one.tabIndex >= 0 && (one.labels?.length || one.textContent || one.ariaLabel))`));
  if (folder) {
    const { data } = await send("Page.printToPDF", { printBackground: false });
    writeFileSync(join(folder, name + ".pdf"), Buffer.from(data, "base64"));
  }
}

const given = process.argv.slice(2), at = given.indexOf("--pictures");
const folder = at < 0 ? null : given.splice(at, 2)[1];
run(async () => {
  for (const file of given) await use(file, folder);
});
