// Opens reports in a headless Chromium and uses them: layers, slider, hypotheses, keys, hovering, dark and light, wide and on a
// phone. Fails on whatever the console says and on what does not change the picture. Needs Node and Chromium, nothing else.
//
//     node tests/browser/report.mjs REPORT.html... [--pictures FOLDER]
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync, mkdirSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const WATCHDOG = 120_000;
const profile = mkdtempSync(join(tmpdir(), "gridweave-browser-"));
const browser = spawn(process.env.CHROMIUM || "chromium", [
  "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-pipe", "--user-data-dir=" + profile, "about:blank",
], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"], detached: true });

let next = 1, rest = "", failed = 0, passed = 0;
const waiting = new Map(), said = [];
let onLoad = () => {};
browser.stdio[4].setEncoding("utf8").on("data", (part) => {
  const messages = (rest + part).split("\0");
  rest = messages.pop();
  for (const { id, result, error, method, params } of messages.map(JSON.parse)) {
    if (id) (error ? waiting.get(id).reject(new Error(error.message)) : waiting.get(id).resolve(result));
    if (method === "Page.loadEventFired") onLoad();
    if (method === "Runtime.exceptionThrown") said.push(params.exceptionDetails.exception?.description || params.exceptionDetails.text);
    if (method === "Runtime.consoleAPICalled") said.push(params.args.map((one) => one.value).join(" "));
    if (method === "Log.entryAdded") said.push(params.entry.text);
  }
});
let session;
function send(method, params = {}) {
  const id = next++;
  browser.stdio[3].write(JSON.stringify({ id, method, params, sessionId: session }) + "\0");
  return new Promise((resolve, reject) => waiting.set(id, { resolve, reject }));
}
function end(status) {
  try { process.kill(-browser.pid); } catch { /* it has ended */ }
  setTimeout(() => { rmSync(profile, { recursive: true, force: true }); process.exit(status); }, 500);
}
setTimeout(() => { console.error("the browser hangs"); end(1); }, WATCHDOG);
browser.on("error", (error) => { console.error("there is no browser: " + error.message); process.exit(1); });

async function evaluate(expression) {
  const { result, exceptionDetails } = await send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
  if (exceptionDetails) throw new Error(exceptionDetails.exception?.description || exceptionDetails.text);
  return result.value;
}
function check(what, holds) {
  holds ? passed++ : failed++;
  if (!holds) console.error("FAILED " + what);
}
// What the canvas shows.
const shown = () => evaluate("canvas.toDataURL()");
async function changes(what, expression) {
  const before = await shown();
  await evaluate(expression);
  check(what + " changes the map", (await shown()) !== before);
}
async function open(file, width, height, scheme) {
  const mobile = width < 600;
  await send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: mobile ? 2 : 1, mobile });
  await send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }] });
  const loaded = new Promise((resolve) => { onLoad = resolve; });
  await send("Page.navigate", { url: pathToFileURL(resolve(file)).href });
  await loaded;
  for (let i = 0; i < 300 && !(await evaluate("document.documentElement.dataset.ready === 'true'")); i++) await new Promise((done) => setTimeout(done, 50));
  check(file + " draws its maps", await evaluate("document.documentElement.dataset.ready === 'true'"));
}
async function picture(folder, name, whole) {
  if (!folder) return;
  mkdirSync(folder, { recursive: true });
  const { data } = await send("Page.captureScreenshot", { format: "png", captureBeyondViewport: whole });
  writeFileSync(join(folder, name + ".png"), Buffer.from(data, "base64"));
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
try {
  const { targetInfos } = await send("Target.getTargets");
  const { sessionId } = await send("Target.attachToTarget", { targetId: targetInfos.find(({ type }) => type === "page").targetId, flatten: true });
  session = sessionId;
  await Promise.all(["Page.enable", "Runtime.enable", "Log.enable"].map((method) => send(method)));
  for (const file of given) await use(file, folder);
} catch (error) {
  failed++;
  console.error("FAILED " + error.stack);
}
check("the console says nothing, but: " + said.join("; "), said.length === 0);
console.log(`${passed} passed, ${failed} failed`);
end(failed ? 1 : 0);
