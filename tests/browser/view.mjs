// Looks on at a live run in a headless Chromium, as `gridweave view` serves it: maps come while robots drive, the view stays as the
// user has set it, and the page says when the run has ended. Needs Node and Chromium, nothing else.
//
//     node tests/browser/view.mjs GRIDWEAVE LOG [--pictures FOLDER]
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { check, evaluate, finallyDo, open, picture, run, shown, until } from "./chromium.mjs";

const given = process.argv.slice(2), at = given.indexOf("--pictures");
const folder = at < 0 ? null : given.splice(at, 2)[1];
const [program, log] = given.map((path) => resolve(path));
const work = mkdtempSync(join(tmpdir(), "gridweave-view-"));
const started = [];
function start(...args) {
  const child = spawn(program, args, { cwd: work, stdio: ["ignore", "pipe", "inherit"] });
  started.push(child);
  return child;
}
const ended = (child) => new Promise((resolve) => child.on("exit", resolve));
finallyDo(() => {
  started.forEach((child) => child.exitCode === null && child.kill("SIGKILL"));
  rmSync(work, { recursive: true, force: true });
});

run(async () => {
  const live = start("run", "live_merge", "--output", "out.mcap");
  live.stdout.resume();
  const ends = ended(live);
  const view = start("view", "--address", "127.0.0.1:0", "--run", "live_merge", "--wait", "60");
  const line = await new Promise((resolve) => createInterface(view.stdout).once("line", resolve));
  const url = line.match(/http:\/\/\S+/)[0];
  const viewEnds = ended(view);
  await open(url, 1280, 900, "light");
  const empty = await shown();
  check("the page is empty before robots come", await evaluate("layers.length === 0"));
  const played = start("play", log, "--rate", "0", "--run", "live_merge");
  played.stdout.resume();
  check("the log is played", (await ended(played)) === 0);
  await until("the robots' maps come", "data.robots.filter((robot) => robot.map.some((one) => one.what)).length >= 2", 60);
  await until("the robots are merged", "data.frames.length >= 2 && data.merged.some((one) => one.what)", 60);
  check("the map is drawn", (await shown()) !== empty);
  check("the headline tells of it", (await evaluate("document.getElementById('headline').textContent")).includes("robots have a frame"));
  check("the stages are told of", (await evaluate("document.getElementById('findings').textContent")).includes("fuser"));
  check("the page says that the run goes on", (await evaluate("document.getElementById('live').textContent")) === "The run goes on.");
  await picture(folder, "view-live", true);
  // What the user sets stays when more comes.
  await evaluate("document.getElementById('layer-robot-0').click(); zoom(2)");
  const set = await evaluate("[camera.scale, layers.find(({ id }) => id === 'robot-0').on]");
  const more = start("play", log, "--rate", "0", "--end", "5", "--run", "live_merge");
  more.stdout.resume();
  await ended(more);
  const before = await evaluate("data.times[0]");
  live.kill("SIGINT");
  check("the run ends well", [0, 3].includes(await ends));
  await until("the page says that the run has ended", "document.getElementById('live').textContent.startsWith('The run has ended')", 30);
  check("the view stays as it was set", JSON.stringify(await evaluate("[camera.scale, layers.find(({ id }) => id === 'robot-0').on]")) === JSON.stringify(set));
  check("the end is later than what was there", (await evaluate("data.times[0]")) >= before);
  check("the view ends with the run", (await viewEnds) === 0);
  await picture(folder, "view-ended", false);
});
