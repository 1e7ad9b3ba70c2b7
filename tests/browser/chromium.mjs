// A headless Chromium, driven by its own protocol, and the checks that are made with it. Needs Node and Chromium, nothing else.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync, mkdirSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const WATCHDOG = 120_000;
const profile = mkdtempSync(join(tmpdir(), "gridweave-browser-"));
const browser = spawn(process.env.CHROMIUM || "chromium", [
  "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-pipe", "--user-data-dir=" + profile, "about:blank",
], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"], detached: true });

let next = 1, rest = "", failed = 0, passed = 0;
const waiting = new Map(), atEnd = [];
/** What the console of a page has said. */
export const said = [];
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
export function send(method, params = {}) {
  const id = next++;
  browser.stdio[3].write(JSON.stringify({ id, method, params, sessionId: session }) + "\0");
  return new Promise((resolve, reject) => waiting.set(id, { resolve, reject }));
}
function end(status) {
  atEnd.forEach((what) => what());
  try { process.kill(-browser.pid); } catch { /* it has ended */ }
  setTimeout(() => { rmSync(profile, { recursive: true, force: true }); process.exit(status); }, 500);
}
setTimeout(() => { console.error("the browser hangs"); end(1); }, WATCHDOG);
browser.on("error", (error) => { console.error("there is no browser: " + error.message); process.exit(1); });

export async function evaluate(expression) {
  const { result, exceptionDetails } = await send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
  if (exceptionDetails) throw new Error(exceptionDetails.exception?.description || exceptionDetails.text);
  return result.value;
}
export function check(what, holds) {
  holds ? passed++ : failed++;
  if (!holds) console.error("FAILED " + what);
}
/** What the canvas shows. */
export const shown = () => evaluate("canvas.toDataURL()");
/** Waits until an expression holds on the page, for a while. */
export async function until(what, expression, seconds = 15) {
  for (let i = 0; i < 20 * seconds && !(await evaluate(expression)); i++) await new Promise((done) => setTimeout(done, 50));
  check(what, await evaluate(expression));
}
/** Opens a page of ours, and waits until it has drawn its maps. */
export async function open(url, width, height, scheme) {
  const mobile = width < 600;
  await send("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: mobile ? 2 : 1, mobile });
  await send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }] });
  const loaded = new Promise((resolve) => { onLoad = resolve; });
  await send("Page.navigate", { url });
  await loaded;
  await until(url + " draws its maps", "document.documentElement.dataset.ready === 'true'");
}
export async function picture(folder, name, whole) {
  if (!folder) return;
  mkdirSync(folder, { recursive: true });
  const { data } = await send("Page.captureScreenshot", { format: "png", captureBeyondViewport: whole });
  writeFileSync(join(folder, name + ".png"), Buffer.from(data, "base64"));
}

/** Something to be done before all ends. */
export const finallyDo = (what) => atEnd.push(what);
/** Does all checks, says how they went, and ends. */
export async function run(checks) {
  try {
    const { targetInfos } = await send("Target.getTargets");
    const { sessionId } = await send("Target.attachToTarget", { targetId: targetInfos.find(({ type }) => type === "page").targetId, flatten: true });
    session = sessionId;
    await Promise.all(["Page.enable", "Runtime.enable", "Log.enable"].map((method) => send(method)));
    await checks();
  } catch (error) {
    failed++;
    console.error("FAILED " + error.stack);
  }
  check("the console says nothing, but: " + said.join("; "), said.length === 0);
  console.log(`${passed} passed, ${failed} failed`);
  end(failed ? 1 : 0);
}
