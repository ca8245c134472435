// SPDX-License-Identifier: Apache-2.0
// The live page in Debian's Chromium: page_test.mjs DKB_SLAM SEQUENCE WORK NPM. Says "skipped: ..." where there is no
// Chromium or the packages cannot be fetched. Pictures are left in WORK.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, rmSync, statSync, symlinkSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";
import { writeTwoMaps } from "./two_maps.mjs";

const [program, sequence, work, npm] = process.argv.slice(2);
const web = new URL("..", import.meta.url).pathname;

function skip(why) {
  console.log("skipped: " + why);
  process.exit(0);
}
const chromium = ["chromium-headless-shell", "chromium"]
  .flatMap((name) => (process.env.PATH ?? "").split(delimiter).map((folder) => join(folder, name))).find(existsSync);
if (!chromium) skip("no Chromium; apt-get install chromium-headless-shell");

mkdirSync(work, { recursive: true });
const lock = readFileSync(join(web, "package-lock.json"), "utf8");
const fetched = join(work, "fetched");
if (!existsSync(fetched) || readFileSync(fetched, "utf8") !== lock) {
  for (const name of ["package.json", "package-lock.json"]) copyFileSync(join(web, name), join(work, name));
  try {
    execFileSync(npm, ["ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"], { cwd: work, timeout: 300000 });
  } catch (error) {
    skip("npm cannot fetch playwright-core: " + error.message.split("\n")[0]);
  }
  writeFileSync(fetched, lock);
}
const { chromium: launcher } = createRequire(join(work, "x.js"))("playwright-core");

// Starts the program and gives the address of its page.
const started = [];
process.on("exit", () => started.forEach((p) => p.kill("SIGKILL")));
async function serve(...words) {
  const process = spawn(program, words, { stdio: ["ignore", "inherit", "pipe"] });
  started.push(process);
  const url = await new Promise((found, failed) => {
    let text = "";
    process.stderr.on("data", (data) => {
      text += data;
      const match = /viewer: (\S+)\n/.exec(text);
      if (match) found(match[1]);
    });
    process.on("exit", () => failed(new Error(words[0] + " ended: " + text)));
  });
  return { process, url };
}
async function interrupted({ process }) {
  return new Promise((ended) => {
    process.on("exit", ended);
    process.kill("SIGINT");
  });
}

// The sequence is over in a second, and a busy machine may not pause it in time: the page sees it six times as slow.
const slow = join(work, "slow");
rmSync(slow, { recursive: true, force: true });
mkdirSync(slow);
for (const folder of ["rgb", "depth"]) symlinkSync(join(sequence, folder), join(slow, folder));
copyFileSync(join(sequence, "camera.yaml"), join(slow, "camera.yaml"));
const pairs = readFileSync(join(sequence, "associations.txt"), "utf8").split("\n").filter((line) => /^\d/.test(line)).map((line) => line.split(" "));
const list = (column) => pairs.map((pair, k) => `${(1700000000 + k * 0.2).toFixed(6)} ${pair[column]}\n`).join("");
writeFileSync(join(slow, "rgb.txt"), list(1));
writeFileSync(join(slow, "depth.txt"), list(3));

const browser = await launcher.launch({ executablePath: chromium, args: ["--no-sandbox", "--enable-unsafe-swiftshader"] });
const run = await serve("run", slow, "--viewer", "0", "--realtime", "--detector", "motion", "--quiet", "--out", join(work, "run"));
const { url } = run;

// Playwright's own waitForFunction evaluates strings, which the page's policy forbids.
async function until(page, holds, argument = null, seconds = 30) {
  for (const end = Date.now() + 1000 * seconds; !(await page.evaluate(holds, argument)); await page.waitForTimeout(50))
    assert.ok(Date.now() < end, "never came: " + holds);
}
const errors = [], outside = [];
async function open(options, address = url) {
  const page = await browser.newPage(options);
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  page.on("pageerror", (e) => errors.push(String(e)));
  page.on("request", (r) => new URL(r.url()).origin !== new URL(address).origin && !/^(blob|data):/.test(r.url()) && outside.push(r.url()));
  const begun = Date.now();
  await page.goto(address);
  await until(page, () => Number(document.getElementById("view")?.dataset.points ?? 0) > 100 || document.body.textContent.includes("no 3-D page"));
  return { page, seconds: (Date.now() - begun) / 1000 };
}
const shoot = (page, name) => page.screenshot({ path: join(work, name + ".png") });
const points = (page) => page.evaluate(() => Number(document.getElementById("view").dataset.points));
const frame = async (page) => Number(/frame (\d+)/.exec(await page.textContent("#count"))[1]);

// The run waits for the page.
const order = (what) => fetch(url + "api/command", { method: "POST", body: JSON.stringify({ do: what }) });
const reached = async (frame) => {
  while ((await (await fetch(url + "api/state")).json()).frame < frame) await new Promise((r) => setTimeout(r, 10));
};
await reached(5);
await order("pause");
const { page } = await open({ viewport: { width: 1280, height: 720 }, colorScheme: "dark" });
if (await page.evaluate(() => document.body.textContent.includes("no 3-D page"))) skip("the page is plain: it was built without node");

// Step by key: the run stands still and goes on by one.
await until(page, () => document.getElementById("badge").textContent === "paused");
await page.waitForTimeout(500);
const at = await frame(page), before = await points(page);
assert.ok(at < 38, "paused before the end: " + at);
await page.keyboard.press("n");
await until(page, (f) => document.getElementById("count").textContent.startsWith(`frame ${f} `), at + 1);
await shoot(page, "paused");

// A picture of what is shown: overlays change it.
const pixels = () => page.evaluate(() => {
  const c = document.getElementById("picture"), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  let sum = 0;
  for (let i = 0; i < d.length; i += 4) sum = (sum * 31 + d[i] + 7 * d[i + 1]) % 1000000007;
  return { sum, colours: new Set(Array.from({ length: 4000 }, (_, k) => d[k * 300] * 256 + d[k * 300 + 1])).size };
});
const withFeatures = await pixels();
assert.ok(withFeatures.colours > 100, "the image is there: " + withFeatures.colours);
await page.click("#overlay-used");
await page.waitForTimeout(200);
assert.notEqual((await pixels()).sum, withFeatures.sum, "the overlay went");
await page.click("#overlay-used");
// Each stage's verdict is an overlay of its own, and what lies under the pointer is told in words.
for (const fate of ["used", "disagrees", "on-mover", "moved", "unused"])
  assert.match(await page.textContent(`label:has(#overlay-${fate})`), / \d+$/, "counts of " + fate);
const told = await page.evaluate(() => {
  const c = document.getElementById("picture"), box = c.getBoundingClientRect(), words = new Set();
  for (let y = 4; y < box.height; y += 6)
    for (let x = 4; x < box.width; x += 6) {
      c.dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + x, clientY: box.top + y }));
      if (c.title) words.add(c.title.replace(/ \(.*/, ""));
    }
  return [...words];
});
assert.ok(told.includes("used"), "told of features: " + told);
await page.click("#overlay-depth");
await page.waitForTimeout(1500);
assert.ok((await pixels()).colours > 20, "depth is there");
await shoot(page, "depth");
await page.click("#overlay-depth");

// Camera by keys and buttons; a distance; a picture to keep.
for (const [key, id] of [["t", "top"], ["g", "free"], ["f", "follow"]]) {
  await page.keyboard.press(key);
  assert.equal(await page.getAttribute("#" + id, "aria-pressed"), "true", id);
}
await page.keyboard.press("t");
await page.waitForTimeout(500);
await shoot(page, "top");
await page.focus("#view");
for (const key of ["ArrowLeft", "ArrowUp", "+"]) await page.keyboard.press(key);
await page.keyboard.press("m");
const box = await page.locator("#view").boundingBox();
for (let i = 0, found = 0; i < 400 && found < 2; i++) {
  await page.mouse.click(box.x + box.width * (0.35 + 0.3 * ((i * 0.618) % 1)), box.y + box.height * (0.3 + (0.4 * (i % 20)) / 20));
  const text = await page.textContent("#measured");
  if (found === 0 && text.includes("second")) found = 1;
  if (found === 1 && / m$/.test(text)) found = 2;
}
assert.match(await page.textContent("#measured"), /^\d+\.\d{3} m$/);
await shoot(page, "measure");
await page.keyboard.press("m");
const [saved] = await Promise.all([page.waitForEvent("download"), page.keyboard.press("p")]);
assert.ok(statSync(await saved.path()).size > 5000, "the picture holds something");
await page.keyboard.press("?");
await shoot(page, "keys");
await page.keyboard.press("Escape");

// Light; then on: the map grows and the events come.
await page.keyboard.press("l");
await page.keyboard.press("f");
await page.keyboard.press("Space");
await until(page, () => document.getElementById("badge").textContent === "ended", null, 60);
await page.waitForTimeout(1500);
await shoot(page, "light");
assert.ok((await points(page)) >= before, "points grow");
assert.ok((await page.locator("#events li").count()) >= 2, "events are listed");
await page.locator("#events button").last().click();
assert.equal(await page.getAttribute("#free", "aria-pressed"), "true", "an event leads to its place");
const geometries = async () => {
  await page.waitForTimeout(300);
  return Number(await page.getAttribute("#view", "data-geometries"));
};
const marked = await geometries();
for (let i = 0; i < 5; i++) {
  await page.locator("#events button").nth(i % 2).click();
  await page.waitForTimeout(100);
}
assert.equal(await geometries(), marked, "marks are made once");
const { calls, cloud } = await page.evaluate(() => ({ calls: Number(document.getElementById("view").dataset.calls), cloud: Number(document.getElementById("view").dataset.cloudCalls) }));
assert.ok(cloud <= 1 + (await points(page)) / 4096 && calls < cloud + 20, `one draw call a block: ${cloud}, ${calls} in all`);

// Who comes late sees all at once; a phone, with motion reduced.
const late = await open({ viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, reducedMotion: "reduce" });
await late.page.waitForTimeout(1000);
assert.equal(await points(late.page), await points(page));
assert.equal(await late.page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true, "no scrolling sideways");
await late.page.screenshot({ path: join(work, "phone.png"), fullPage: true });
await shoot(page, "event");

assert.deepEqual(errors, []);
assert.equal(await interrupted(run), 0);
await page.close();

// A new run at the same address: the view leaves the whole map of the one before and follows the camera again.
const again = await serve("run", slow, "--viewer", new URL(url).port, "--realtime", "--detector", "motion", "--quiet", "--out", join(work, "again"));
await reached(1); // a run that is paused before its first frame has nothing to show
await order("pause");
await until(late.page, () => document.getElementById("badge").textContent === "paused" && document.getElementById("count").textContent.startsWith("frame "));
await late.page.waitForTimeout(500);
assert.ok((await frame(late.page)) < 15, "paused while the camera is near its start");
const look = (await late.page.getAttribute("#view", "data-look")).split(" ").map(Number);
assert.ok(Math.hypot(look[0], look[1] + 0.8, look[2] + 1.6) < 0.5, "behind the camera: " + look);
await interrupted(again);
await late.page.close();
errors.length = 0; // the pages have lost their server

// Replay.
for (const [preset, more] of [["default", ["--dense"]], ["orb", []]])
  execFileSync(program, ["run", sequence, "--record", "--detector", "none", "--preset", preset, ...more, "--quiet", "--out", join(work, preset)]);
const replay = await serve("view", join(work, "orb"), "--port", "0", "--quiet");
const { page: film } = await open({ viewport: { width: 1280, height: 720 }, colorScheme: "dark" }, replay.url);
const settled = (p) => until(p, () => document.body.dataset.settled === "true");
const slide = async (p, share) => {
  await p.evaluate((s) => {
    const slider = document.getElementById("slider");
    slider.value = String(s * Number(slider.max));
    slider.dispatchEvent(new Event("input"));
  }, share);
  await settled(p);
  await p.waitForTimeout(500);
};
await film.selectOption("#speed", "Infinity");
await until(film, () => document.getElementById("play").textContent === "Play");
await film.waitForTimeout(500);
const all = await points(film);
assert.equal(await frame(film), 39, "counted from 0");
assert.equal(await frame(film), (await (await fetch(replay.url + "api/state")).json()).frame, "as programs are told");
assert.equal(await film.textContent("#badge"), "ended");
await slide(film, 0.5);
const middle = await frame(film);
assert.ok(middle > 15 && middle < 25, "the middle: " + middle);
assert.ok((await points(film)) < all, "fewer points in the middle");
assert.ok((await film.locator("#events .future").count()) > 0, "what is to come is listed");
for (const [key, wanted] of [["n", middle + 1], ["n", middle + 2], ["b", middle + 1], ["b", middle]]) {
  await film.keyboard.press(key);
  await until(film, (f) => document.getElementById("count").textContent.startsWith(`frame ${f} `), wanted);
  await settled(film);
}
await shoot(film, "replay");
await film.keyboard.press("Home");
await settled(film);
assert.equal(await frame(film), 0);
await film.locator("#events button").nth(1).click();
await settled(film);
assert.ok((await frame(film)) > 0, "an event leads to its time");
await film.keyboard.press("End");
await settled(film);
await film.waitForTimeout(500);
assert.equal(await points(film), all, "as many points as before at the end");

// At its end a replay shows the whole map from where most of it is seen.
const lookOf = (p) => p.getAttribute("#view", "data-look");
await film.keyboard.press("f");
await film.waitForTimeout(3000);
const whole = (await lookOf(film)).split(" ").map(Number);
await slide(film, 0.99);
await film.waitForTimeout(3000);
const behind = (await lookOf(film)).split(" ").map(Number);
assert.ok(Math.hypot(...whole.map((v, k) => v - behind[k])) > 0.5, `the whole map at the end ${whole}, the camera before it ${behind}`);

// Maps that are not joined are not drawn over each other.
writeTwoMaps(join(work, "maps.dkbs"));
const maps = await serve("view", join(work, "maps.dkbs"), "--port", "0", "--quiet");
const { page: atlas } = await open({ viewport: { width: 1280, height: 720 }, colorScheme: "dark", reducedMotion: "reduce" }, maps.url);
await atlas.keyboard.press("Space");
// What is red and green in the view, as it is drawn.
const squares = (name) => atlas.evaluate(async (png) => {
  const image = await createImageBitmap(new Blob([Uint8Array.from(atob(png), (c) => c.charCodeAt(0))]));
  const g = new OffscreenCanvas(image.width, image.height).getContext("2d");
  g.drawImage(image, 0, 0);
  const d = g.getImageData(0, 0, image.width, image.height).data;
  let red = 0, green = 0;
  for (let i = 0; i < d.length; i += 4) {
    if (d[i] > 200 && d[i + 1] < 80 && d[i + 2] < 80) red++;
    if (d[i + 1] > 200 && d[i] < 80 && d[i + 2] < 80) green++;
  }
  return { red: red > 500, green: green > 500 };
}, name);
const seen = async (name) => {
  await atlas.waitForTimeout(500);
  await shoot(atlas, name);
  return squares((await atlas.locator("#view").screenshot()).toString("base64"));
};
await slide(atlas, 5 / 29);
assert.deepEqual(await seen("map_1"), { red: true, green: false });
assert.equal(await atlas.textContent("#maps"), "");
await slide(atlas, 15 / 29);
assert.deepEqual(await seen("map_2"), { red: false, green: true });
assert.equal(await atlas.textContent("#maps"), "map 2 of 2, not joined");
await atlas.keyboard.press("t");
const above = (await lookOf(atlas)).split(" ").map(Number);
assert.ok(above.every((v) => Math.abs(v) < 100), "what is out of sight does not count: " + above);
await atlas.keyboard.press("f");
await slide(atlas, 25 / 29);
assert.equal(await atlas.getAttribute("#view", "data-shown"), "0", "joined to the first");
await slide(atlas, 1);
assert.deepEqual(await seen("maps_joined"), { red: true, green: true });
assert.equal(await atlas.textContent("#maps"), "");
writeTwoMaps(join(work, "older.dkbs"), 1);
const older = await serve("view", join(work, "older.dkbs"), "--port", "0", "--quiet");
const refused = await browser.newPage();
await refused.goto(older.url);
await until(refused, () => document.getElementById("badge")?.textContent.includes("this recording is of another version"));
assert.equal(await points(refused), 0, "nothing of it is shown");
await refused.close();

// Two side by side, at the same time and with the same view.
const two = await serve("view", join(work, "orb"), join(work, "default"), "--port", "0", "--quiet");
const { page: pair } = await open({ viewport: { width: 1280, height: 720 }, colorScheme: "dark" }, two.url);
await pair.keyboard.press("Space");
await slide(pair, 0.7);
const counts = await pair.locator(".count").allTextContents();
assert.equal(counts.length, 2);
assert.ok(Math.abs(parseInt(counts[0].slice(6)) - parseInt(counts[1].slice(6))) <= 1, "the same time: " + counts);
assert.deepEqual(await pair.locator(".name").allTextContents(), ["orb", "default"]);
const right = await pair.locator(".view").nth(1).boundingBox();
await pair.mouse.move(right.x + 200, right.y + 150);
await pair.mouse.down();
await pair.mouse.move(right.x + 300, right.y + 100, { steps: 4 });
await pair.mouse.up();
await slide(pair, 1);
assert.equal(await pair.isVisible("#layer-surface"), true, "the second run has a dense map");
assert.equal(await film.isVisible("#layer-surface"), false, "that one has none");
// What is to come, or of another world, is not shown by a layer that is switched on again.
const drawn = (layer) => pair.locator(".view").nth(1).evaluate((view, name) => view.dataset[name], layer);
assert.equal(await drawn("surface"), "true");
assert.equal(await drawn("truth"), "true");
for (const layer of ["surface", "truth"]) await pair.click("#layer-" + layer);
await slide(pair, 0);
for (const layer of ["surface", "truth"]) await pair.click("#layer-" + layer);
await pair.waitForTimeout(500);
assert.equal(await drawn("surface"), "false", "no dense map was made yet");
assert.equal(await drawn("truth"), "false", "the truth lies in no place yet");
await slide(pair, 1);
assert.equal(await drawn("surface"), "true");
assert.equal(await drawn("truth"), "true");
assert.ok((await film.locator("#stages button").count()) >= 4, "stages are told apart");
assert.match(await film.textContent("#rules"), /first.*baseline/);
// Legends take a line more where one is too short for them, and the last time stays inside.
for (const p of [film, pair])
  assert.deepEqual(await p.evaluate(() => [...document.querySelectorAll(".chart")].flatMap((chart) => {
    const whole = chart.getBoundingClientRect(), plot = chart.querySelector(".u-over").getBoundingClientRect();
    const cut = [...chart.querySelectorAll("small > *")].filter((e) => {
      const box = e.getBoundingClientRect(), at = document.elementFromPoint(box.x + box.width - 2, box.y + box.height / 2);
      return box.right > whole.right || box.bottom > plot.top || !e.contains(at);
    });
    return [...cut.map((e) => e.textContent), ...(plot.right + 18 > whole.right ? ["the last time"] : [])];
  })), [], "cut off");
await until(pair, () => new Set([...document.querySelectorAll(".view")].map((view) => view.dataset.look)).size === 1);
assert.equal(await pair.getAttribute("#free", "aria-pressed"), "true");
await shoot(pair, "compare");
const small = await open({ viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true }, two.url);
assert.equal(await small.page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), true, "no scrolling sideways");
await small.page.waitForTimeout(1000);
await small.page.screenshot({ path: join(work, "compare_phone.png"), fullPage: true });

assert.deepEqual(errors, []);
assert.deepEqual(outside, []);
await browser.close();
for (const server of [replay, maps, older, two]) assert.equal(await interrupted(server), 0);
console.log(`the page is as it should be; a late visitor saw the map after ${late.seconds.toFixed(1)} s`);
process.exit(0);
