// SPDX-License-Identifier: Apache-2.0
// What the page reaches in Chromium's software renderer: page_figures.mjs DKB_SLAM NODE_MODULES [WORK]
// Prints frames a second while the map turns, draw calls and load time with 1,000,000 points, memory of a long replay.
// NODE_MODULES holds playwright-core: build/tests/page/node_modules after the test project.page.
import { execFileSync, spawn } from "node:child_process";
import { closeSync, existsSync, mkdirSync, openSync, writeSync } from "node:fs";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";

const [program, modules, work = "/tmp/dkb-page-figures"] = process.argv.slice(2);
const { chromium: launcher } = createRequire(join(modules, "x.js"))("playwright-core");
const executablePath = ["chromium-headless-shell", "chromium"]
  .flatMap((name) => (process.env.PATH ?? "").split(delimiter).map((folder) => join(folder, name))).find(existsSync);
mkdirSync(work, { recursive: true });

// A session file as src/dkb/viewer/session_file.h and map_deltas.h lay it out: the camera goes round a square, every
// `every` frames a keyframe is made with `points` points on walls of random colour.
function writeSession(path, { frames, every, points, features }) {
  const file = openSync(path, "w");
  const message = (kind, ...parts) => {
    const body = Buffer.concat(parts.map((p) => (typeof p === "string" ? Buffer.from(p) : Buffer.from(p.buffer, p.byteOffset, p.byteLength))));
    const head = Buffer.alloc(8);
    head.writeUInt32LE(body.length, 0);
    head.writeUInt32LE(kind, 4);
    return Buffer.concat([head, body]);
  };
  const chunk = (time, frame, messages) => {
    const body = Buffer.concat(messages), head = Buffer.alloc(32);
    head.writeUInt32LE(24, 0);
    head.writeUInt32LE(13, 4);
    head.write("DKBS", 8);
    head.writeUInt32LE(frame === frames - 1 ? 2 : 0, 12);
    head.writeDoubleLE(time, 16);
    head.writeInt32LE(frame, 24);
    head.writeUInt32LE(body.length, 28);
    writeSync(file, head);
    writeSync(file, body);
  };
  let seed = 1;
  const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  const hello = { protocol: 2, source: `${points} points every ${every} frames`, budget_ms: 33.3, unit: 0.001, feature_unit: 1 / 16,
    camera: { width: 640, height: 480, fx: 525, fy: 525, cx: 320, cy: 240 } };
  chunk(0, -1, [message(1, JSON.stringify(hello))]);
  let made = 0;
  for (let f = 0; f < frames; f++) {
    const angle = (2 * Math.PI * f) / Math.min(frames, 3000), at = [4 * Math.cos(angle), 0, 4 * Math.sin(angle)];
    const turn = [0, Math.sin(-angle / 2), 0, Math.cos(-angle / 2)];
    const messages = [];
    if (f % every === 0) {
      const keyframe = Buffer.alloc(40);
      keyframe.writeInt32LE(made, 0);
      [...turn, ...at].forEach((v, i) => keyframe.writeFloatLE(v, 12 + 4 * i));
      const list = Buffer.alloc(8 + 12 * points);
      list.writeUInt32LE(made, 0);
      list.writeUInt32LE(points, 4);
      for (let i = 0; i < points; i++) {
        const o = 8 + 12 * i;
        list.writeUInt16LE(i, o);
        [3000, 3000, 4000].forEach((size, k) => list.writeInt16LE(Math.round((random() - 0.5) * size) + (k === 2 ? 3000 : 0), o + 2 + 2 * k));
        for (let k = 0; k < 3; k++) list[o + 8 + k] = 255 * random();
        list[o + 11] = 3;
      }
      messages.push(message(2, keyframe), message(3, list));
      made++;
    }
    const fact = Buffer.alloc(16);
    fact.writeUInt32LE(f, 0);
    fact.writeFloatLE(10 + 5 * random(), 4);
    fact.writeFloatLE(f / 30, 8);
    fact.writeUInt16LE(400, 12);
    fact[14] = 1;
    const path = Buffer.alloc(20);
    path.writeUInt32LE(f, 0);
    path.writeInt32LE(made - 1, 4);
    let json = JSON.stringify({ state: { frame: f, frames, tracked: f, lost: 0, state: "tracking", inliers: 400, keyframes: made, map_points: made * points,
      loops: 0, movers: 0, tracking_ms: 12, paused: false, ended: f === frames - 1 }, explanation: "", map: 0, camera: [...turn, ...at], movers: [], boxes: [] });
    json += " ".repeat((4 - (json.length % 4)) % 4);
    const seen = Buffer.alloc(4 + 6 * features + 12);
    seen.writeUInt32LE(features, 0);
    for (let i = 0; i < features; i++) {
      seen.writeUInt16LE(10200 * random(), 4 + 6 * i);
      seen.writeUInt16LE(7600 * random(), 6 + 6 * i);
      seen[8 + 6 * i] = 1;
    }
    const length = Buffer.alloc(4);
    length.writeUInt32LE(json.length);
    messages.push(message(7, fact), message(9, length, json, seen));
    if (f % 10 === 0) messages.push(message(6, path));
    if (f % every === 0) messages.push(message(8, JSON.stringify([{ kind: "keyframe", frame: f, text: "adaptive", time: f / 30 }])));
    chunk(f / 30, f, messages);
  }
  closeSync(file);
}

const servers = [];
process.on("exit", () => servers.forEach((s) => s.kill("SIGKILL")));
async function view(path) {
  const server = spawn(program, ["view", path, "--port", "0", "--quiet"], { stdio: ["ignore", "inherit", "pipe"] });
  servers.push(server);
  return new Promise((found) => server.stderr.on("data", (data) => {
    const match = /viewer: (\S+)\n/.exec(String(data));
    if (match) found({ url: match[1], pid: server.pid });
  }));
}
const rss = (pid) => {
  const pages = execFileSync("ps", ["-eo", "pid,ppid,rss,args"]).toString().split("\n").map((l) => l.trim().split(/\s+/));
  const below = new Set([String(pid)]);
  for (let grown = true; grown; ) {
    grown = false;
    for (const [p, parent] of pages) if (below.has(parent) && !below.has(p)) grown = !!below.add(p);
  }
  return pages.filter(([p, , , ...args]) => below.has(p) && (p === String(pid) ? below.size === 1 : args.join(" ").includes("--type=renderer")))
    .reduce((sum, [, , kb]) => sum + Number(kb) / 1024, 0);
};
const browser = await launcher.launchServer({ executablePath, args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--enable-precise-memory-info"] });
const connected = await launcher.connect(browser.wsEndpoint());
async function open(url) {
  const page = await connected.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(url);
  await page.waitForSelector("#view");
  return page;
}
const data = (page, name) => page.evaluate((n) => Number(document.getElementById("view").dataset[n]), name);
async function until(page, holds, argument) {
  while (!(await page.evaluate(holds, argument))) await page.waitForTimeout(50);
}
const ended = (page) => until(page, () => document.getElementById("play").textContent === "Play" && document.body.dataset.settled === "true");
async function turn(page, seconds) {
  await page.keyboard.press("t");
  await page.waitForTimeout(1500);
  await page.mouse.move(400, 300);
  await page.mouse.down();
  for (let i = 0; i < 60; i++) await page.mouse.move(400 + 3 * i, 300 + (i % 20)); // until the number of points has settled
  const before = await data(page, "drawn"), start = Date.now();
  for (let i = 0; Date.now() - start < 1000 * seconds; i++) await page.mouse.move(400 + 150 * Math.sin(i / 15), 300 + 20 * Math.cos(i / 25));
  const rate = ((await data(page, "drawn")) - before) / ((Date.now() - start) / 1000);
  await page.mouse.up();
  return rate;
}

const small = join(work, "small.dkbs"), million = join(work, "million.dkbs"), long = join(work, "long.dkbs");
writeSession(small, { frames: 300, every: 5, points: 300, features: 500 });
writeSession(million, { frames: 500, every: 2, points: 4000, features: 100 });
writeSession(long, { frames: 60000, every: 60, points: 60, features: 300 });

for (const [name, path] of [["18,000 points", small], ["1,000,000 points", million]]) {
  const { url } = await view(path);
  const started = Date.now();
  const page = await open(url);
  await page.keyboard.press("Space");
  await page.keyboard.press("End");
  await until(page, (n) => Number(document.getElementById("view").dataset.points) >= n, name.startsWith("1,") ? 1000000 : 18000);
  console.log(`${name}: shown after ${((Date.now() - started) / 1000).toFixed(1)} s; ${await data(page, "cloudCalls")} draw calls for the points, ${await data(page, "calls")} in all`);
  console.log(`  ${(await turn(page, 8)).toFixed(0)} frames/s while it turns`);
  await page.close();
}
const { url, pid } = await view(long);
const page = await open(url);
await page.selectOption("#speed", "Infinity");
const session = await page.context().newCDPSession(page);
const start = Date.now();
for (let done = false; !done; ) {
  await page.waitForTimeout(4000);
  done = await page.evaluate(() => document.getElementById("play").textContent === "Play");
  await session.send("HeapProfiler.collectGarbage");
  const clock = await page.textContent("#clock");
  const used = await page.evaluate(() => performance.memory.usedJSHeapSize / 1e6);
  console.log(`long replay, ${clock}: JavaScript ${used.toFixed(0)} MB, renderer ${rss(browser.process().pid).toFixed(0)} MB, server ${rss(pid).toFixed(0)} MB`);
}
console.log(`60,000 frames in ${((Date.now() - start) / 1000).toFixed(0)} s`);
await connected.close();
await browser.close();
process.exit(0);
