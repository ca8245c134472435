// SPDX-License-Identifier: Apache-2.0
// The README's pictures of the page and of the report: page_pictures.mjs DKB_SLAM NODE_MODULES SEQUENCE OUT
// NODE_MODULES holds playwright-core: build/tests/page/node_modules after the test project.page.
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { basename, delimiter, dirname, join, resolve } from "node:path";

const [program, modules, sequence, out] = process.argv.slice(2);
const { chromium: launcher } = createRequire(join(modules, "x.js"))("playwright-core");
const executablePath = ["chromium-headless-shell", "chromium"]
  .flatMap((name) => (process.env.PATH ?? "").split(delimiter).map((folder) => join(folder, name))).find(existsSync);
const work = mkdtempSync(join(tmpdir(), "dkb-pictures-"));
// The pictures tell the sequence's name and not where it lies.
for (const [name, more] of [["default", ["--detector", "motion"]], ["orb", ["--preset", "orb"]]])
  execFileSync(resolve(program), ["run", basename(sequence), "--record", "--quiet", ...more, "--out", join(work, name)], { cwd: dirname(resolve(sequence)) });

const browser = await launcher.launch({ executablePath, args: ["--no-sandbox", "--enable-unsafe-swiftshader"] });
const servers = [];
process.on("exit", () => servers.forEach((s) => s.kill("SIGKILL")));
async function view(...names) {
  const server = spawn(program, ["view", ...names.map((n) => join(work, n)), "--port", "0", "--quiet"], { stdio: ["ignore", "inherit", "pipe"] });
  servers.push(server);
  const url = await new Promise((found) => server.stderr.on("data", (data) => {
    const match = /viewer: (\S+)\n/.exec(String(data));
    if (match) found(match[1]);
  }));
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 }, colorScheme: "dark" });
  await page.goto(url);
  await page.waitForSelector("#view");
  await page.keyboard.press("Space");
  return page;
}
async function slide(page, share) {
  await page.evaluate((s) => {
    const slider = document.getElementById("slider");
    slider.value = String(s * Number(slider.max));
    slider.dispatchEvent(new Event("input"));
  }, share);
  await page.waitForSelector('body[data-settled="true"]');
  await page.waitForTimeout(4000); // the camera follows smoothly
}
const shoot = (page, name) => page.screenshot({ path: join(out, name + ".jpg"), type: "jpeg", quality: 80 });

const one = await view("default");
await slide(one, 0.6);
await shoot(one, "page");
const two = await view("default", "orb");
await slide(two, 0.6);
await shoot(two, "page_compare");
const report = await browser.newPage({ viewport: { width: 1000, height: 1000 }, colorScheme: "light" });
await report.goto("file://" + join(work, "default", "report.html"));
await shoot(report, "report");
await browser.close();
process.exit(0);
