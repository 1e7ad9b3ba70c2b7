// Opens a merged log with the layout that ships in Foxglove Studio, the last open-source one, in a real browser.
//
//     node tests/viewers/foxglove_studio/studio.mjs GRIDWEAVE MODULES [--pictures FOLDER]
//
// MODULES is a folder `node_modules` with what package.json names. Needs Chromium.
import { execFileSync } from "node:child_process";
import { createServer } from "node:http";
import { chmodSync, createReadStream, existsSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, extname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const [gridweave, modules, ...options] = process.argv.slice(2);
const pictures = options[0] === "--pictures" ? options[1] : undefined;
const here = dirname(fileURLToPath(import.meta.url));
const layout = join(here, "../../../pipelines/viewers/foxglove.json");
const folder = mkdtempSync(join(tmpdir(), "gridweave-studio-"));

// WebGL without a graphics card, and nothing but the page on the network.
const browser = join(folder, "browser");
const flags = "--use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic --disable-background-networking " +
  "--disable-component-update --disable-sync";
writeFileSync(browser, `#!/bin/sh\nexec ${process.env.CHROMIUM || "chromium"} ${flags} "$@"\n`);
chmodSync(browser, 0o755);
process.env.CHROMIUM = browser;
const { check, evaluate, finallyDo, picture, run, said, send, until } = await import("../../browser/chromium.mjs");
finallyDo(() => rmSync(folder, { recursive: true, force: true }));

const log = join(folder, "merged.mcap");
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".json": "application/json", ".wasm": "application/wasm" };
const PATHS = { "/": join(here, "host.html"), "/host.js": join(here, "host.js"), "/layout.json": layout, "/merged.mcap": log };
/** Serves the page, the modules and the log, of which Studio asks for ranges. */
const server = createServer((request, response) => {
  const { pathname } = new URL(request.url, "http://localhost");
  if (pathname === "/favicon.ico") return response.writeHead(204).end();
  const file = PATHS[pathname] ?? (pathname.startsWith("/modules/") ? join(modules, pathname.slice("/modules/".length)) : "");
  if (!existsSync(file)) return response.writeHead(404).end();
  const size = statSync(file).size;
  const headers = { "content-type": TYPES[extname(file)] ?? "application/octet-stream", "accept-ranges": "bytes" };
  const [, first, last] = /bytes=(\d+)-(\d*)/.exec(request.headers.range ?? "") ?? [];
  const start = Number(first ?? 0), end = last ? Math.min(Number(last), size - 1) : size - 1;
  if (first !== undefined) headers["content-range"] = `bytes ${start}-${end}/${size}`;
  response.writeHead(first === undefined ? 200 : 206, { ...headers, "content-length": end - start + 1 });
  if (request.method === "HEAD") response.end();
  else createReadStream(file, { start, end }).pipe(response);
});
await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
const address = `http://127.0.0.1:${server.address().port}`;

const COLOURS = { unknown: [181, 196, 194], robot1: [0, 114, 178], robot2: [213, 94, 0], robot3: [0, 158, 115] };
/** Where the canvas of the 3D panel is, how many pixels of it have each colour, and between which edges those of the map are. */
async function seen() {
  const { data } = await send("Page.captureScreenshot", { format: "png" });
  return evaluate(`(async () => {
    const canvas = [...document.querySelectorAll("canvas")].sort((a, b) => b.width * b.height - a.width * a.height)[0];
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const picture = await createImageBitmap(await (await fetch("data:image/png;base64,${data}")).blob());
    const context = new OffscreenCanvas(width, height).getContext("2d");
    context.drawImage(picture, -left, -top);
    const pixels = context.getImageData(0, 0, width, height).data, found = { width, height };
    for (const [name, colour] of Object.entries(${JSON.stringify(COLOURS)})) {
      const one = found[name] = { number: 0, left: width, right: -1, top: height, bottom: -1 };
      const from = colour.map((value) => 255 - value), length = from.reduce((sum, value) => sum + value * value, 0);
      for (let i = 0; i < pixels.length; i += 4) {
        // Lines are thinner than a pixel: their colour is mixed with the white of free cells.
        const share = name === "unknown" ? 1 : from.reduce((sum, value, j) => sum + value * (255 - pixels[i + j]), 0) / length;
        const off = from.reduce((sum, value, j) => sum + Math.abs(255 - pixels[i + j] - share * value), 0);
        if (share < 0.35 || off > (name === "unknown" ? 12 : 40)) continue;
        const x = i / 4 % Math.floor(width), y = Math.floor(i / 4 / Math.floor(width));
        one.number++;
        one.left = Math.min(one.left, x), one.right = Math.max(one.right, x);
        one.top = Math.min(one.top, y), one.bottom = Math.max(one.bottom, y);
      }
    }
    return found;
  })()`);
}

run(async () => {
  finallyDo(() => server.close());
  execFileSync(resolve(gridweave), ["simulate", "-o", join(folder, "robots.mcap")]);
  execFileSync(resolve(gridweave), ["merge", join(folder, "robots.mcap"), "-o", log, "--map", join(folder, "merged.yaml")]);
  const [, columns, rows] = readFileSync(join(folder, "merged.pgm"), "latin1").match(/^P5\s+(\d+)\s+(\d+)/).map(Number);
  const map = { width: 0.05 * columns, height: 0.05 * rows };
  await send("Emulation.setDeviceMetricsOverride", { width: 1400, height: 900, deviceScaleFactor: 1, mobile: false });
  // At the end of the log, where all is merged.
  const source = { ds: "remote-file", "ds.url": address + "/merged.mcap", layoutId: "gridweave", time: "2100-01-01T00:00:00Z" };
  await send("Page.navigate", { url: `${address}/?${new URLSearchParams(source)}` });
  await until("Studio starts", "document.querySelector('canvas') !== null", 60);
  let found;
  for (let i = 0; i < 100; i++) {
    found = await seen();
    if (found.unknown.number > 1000 && found.robot3.number > 50) break;
    await new Promise((done) => setTimeout(done, 200));
  }
  await picture(pictures, "studio");
  const { unknown, width, height } = found;
  check("the 3D panel shows the merged map: " + JSON.stringify(found), unknown.number > 1000);
  for (const robot of ["robot1", "robot2", "robot3"]) check("the path and the walls of " + robot, found[robot].number > 50);
  const metres = map.height / (unknown.bottom - unknown.top + 1);
  const wide = metres * (unknown.right - unknown.left + 1);
  check(`the map is ${map.width} m wide: ${wide}`, Math.abs(wide - map.width) < 5 * metres);
  check("the map is whole", unknown.left > 0 && unknown.top > 0 && unknown.right < width - 1 && unknown.bottom < height - 1);
  check(`maps of 90 m are whole, too: ${metres * width} m by ${metres * height} m`, metres * Math.min(width, height) > 90);
  const text = await evaluate("document.body.innerText");
  const told = [/robot2\/map/, /\/verdicts/, /has_transform/].every((words) => words.test(text));
  check("the panels show the frames and the verdicts: " + text, told);
  await evaluate("[...document.querySelectorAll('button')].find((button) => /^Problems/.test(button.innerText)).click()");
  await until("Studio has no problems with the log", "/No problems/i.test(document.body.innerText)", 5);
  await picture(pictures, "problems");
  const errors = said.filter((one) => /\bError\b|Failed to/.test(one));
  check("no errors on the console: " + errors.join("\n"), errors.length === 0);
  // Studio says much more there, which is no fault.
  said.length = 0;
});
