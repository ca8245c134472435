// SPDX-License-Identifier: Apache-2.0
// The player of recorded sessions: player_test.mjs PACKAGES, a folder where esbuild is. Says "skipped: ..." where it is not.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";

const packages = resolve(process.argv[2] ?? ".");
const web = new URL("..", import.meta.url).pathname;
if (!existsSync(join(packages, "node_modules", "esbuild"))) {
  console.log("skipped: no esbuild in " + packages + "; the page is plain");
  process.exit(0);
}
const { buildSync } = createRequire(join(packages, "x.js"))("esbuild");
async function load(name) {
  const [bundle] = buildSync({ entryPoints: [join(web, "src", name)], bundle: true, write: false, format: "esm" }).outputFiles;
  return import("data:text/javascript;base64," + Buffer.from(bundle.text).toString("base64"));
}

globalThis.location = { hash: "" };
globalThis.document = { hidden: false };
// A clock that each look moves on: a turn of 12 ms tells one chunk.
let clock = 0;
Object.defineProperty(performance, "now", { value: () => (clock += 7) });
const { Player } = await load("player.ts");

// Chunks as src/dkb/viewer/session_file.h writes them, each with one message.
const message = 3, ofCheckpoint = 2;
function chunk(flags, time, frame, kind, bytes) {
  const data = new Uint8Array(32 + 8 + bytes), view = new DataView(data.buffer);
  view.setUint32(12, flags, true);
  view.setFloat64(16, time, true);
  view.setInt32(24, frame, true);
  view.setUint32(28, 8 + bytes, true);
  view.setUint32(32, bytes, true);
  data[36] = kind;
  return data;
}
// 200 frames with a checkpoint of 4 MB, more than is fetched ahead, after `before` of them.
function recording(before) {
  const chunks = [chunk(1, 0, 0, ofCheckpoint, 100)];
  for (let i = 1; i <= 200; i++) {
    chunks.push(chunk(0, i * 0.1, i, message, 20000));
    if (i === before) chunks.push(chunk(1, i * 0.1, i, ofCheckpoint, 4 << 20));
  }
  return Buffer.concat(chunks);
}
function player(file) {
  const told = [], badges = [];
  const panel = { take: ({ kind }) => told.push(kind), badge: (name) => badges.push(name) };
  const info = { name: "x", seconds: 20, frame: 200, frames: 200, size: file.length, ended: true, damaged: false, entries: [[0, 0, 0]] };
  return { player: new Player(0, info, panel), told, badges };
}
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

// Wherever the checkpoint lies in what is fetched, and whenever the answer comes, all is told once and no checkpoint but the first.
for (const before of [40, 104, 105, 106, 150])
  for (const wait of [1, 25]) {
    const file = recording(before);
    globalThis.fetch = async (url) => {
      const [, from, to] = /from=(\d+)&to=(\d+)/.exec(url).map(Number);
      await pause(wait);
      return { ok: true, arrayBuffer: async () => Uint8Array.from(file.subarray(from, to)).buffer };
    };
    const { player: p, told, badges } = player(file);
    p.seek(0, false);
    let all = false;
    for (let turn = 0; turn < 1500 && !all; turn++) {
      all = p.advance(20, 12);
      await pause(1);
    }
    const where = `a checkpoint after ${before}, answers after ${wait} ms`;
    assert.deepEqual(badges, [], where);
    assert.equal(p.frame, 200, where);
    assert.equal(told.filter((kind) => kind === message).length, 200, where);
    assert.equal(told.filter((kind) => kind === ofCheckpoint).length, 1, where);
  }

// Fetches that fail are not tried again with every turn, and the film goes on when they succeed.
for (const failing of [async () => ({ ok: false, status: 500 }), async () => { throw new TypeError("no network"); },
  async () => ({ ok: true, arrayBuffer: async () => new ArrayBuffer(0) })]) { // of a file that has become shorter
  const file = recording(0);
  let fetches = 0;
  globalThis.fetch = (url) => (fetches++, failing(url));
  const { player: p, badges } = player(file);
  p.seek(0, false);
  const begun = clock;
  while (clock - begun < 4000) {
    p.advance(20, 12);
    await pause(0);
  }
  assert.ok(fetches >= 3 && fetches <= 5, `fetches in 4 s, 250, 500, 1000 and 2000 ms apart: ${fetches}`);
  assert.ok(badges.includes("gone"), "it is told");
  globalThis.fetch = async (url) => {
    const [, from, to] = /from=(\d+)&to=(\d+)/.exec(url).map(Number);
    return { ok: true, arrayBuffer: async () => Uint8Array.from(file.subarray(from, to)).buffer };
  };
  let all = false;
  for (let turn = 0; turn < 5000 && !all; turn++) {
    all = p.advance(20, 12);
    await pause(0);
  }
  assert.equal(p.frame, 200, "it goes on");
}

// Pictures are decoded in any order: an older one takes no newer one's place, and none comes after the world has begun
// anew. A frame without images is no error.
const { Picture } = await load("picture.ts");
globalThis.requestAnimationFrame = () => {};
const decoding = [];
globalThis.createImageBitmap = () => new Promise((done) => {
  const bitmap = { closed: false, close: () => (bitmap.closed = true) };
  decoding.push({ bitmap, done: () => done(bitmap) });
});
const picture = new Picture({});
const tell = (bytes = 9) => picture.takeImage(new DataView(new ArrayBuffer(4 + bytes)));
picture.begin(640, 480, 1);
const [first, second, third] = [tell(), tell(), tell()];
decoding[1].done();
await second;
decoding[0].done();
await first;
assert.ok(decoding[0].bitmap.closed && !decoding[1].bitmap.closed, "the newer one stays");
picture.begin(640, 480, 1);
decoding[2].done();
await third;
assert.ok(decoding[1].bitmap.closed && decoding[2].bitmap.closed, "none is left of the world before");
await tell(0);
assert.equal(decoding.length, 3, "nothing to decode");

// Of maps that are not joined one is shown: the camera's, or that of an event that was gone to.
const { Maps } = await load("maps.ts");
const maps = new Maps();
maps.take(0, 0, false);
maps.take(1, 0, false);
assert.deepEqual([maps.shown, maps.words], [0, ""]);
maps.takeCamera(0);
maps.takeCamera(2); // whose first keyframe is not told yet
assert.deepEqual([maps.shows(0), maps.shows(2), maps.words], [false, true, "map 2 of 2, not joined"]);
maps.take(2, 2, false);
maps.take(3, 2, false);
maps.takeCamera(-1); // lost
assert.deepEqual([maps.shows(1), maps.shows(3)], [false, true]);
maps.visit(1);
assert.deepEqual([maps.shows(1), maps.shows(3), maps.showsCamera, maps.words], [true, false, false, "map 1 of 2, not joined"]);
maps.leave();
assert.equal(maps.shown, 2);
maps.take(2, 0, false); // joined, and the camera's frame is not told yet
maps.take(3, 0, false);
assert.deepEqual([maps.shows(1), maps.shows(3), maps.showsCamera, maps.words], [true, true, true, ""]);
console.log("the player is as it should be");
