// SPDX-License-Identifier: Apache-2.0
// Where the grid of the dense map is drawn: dense_test.mjs PACKAGES, a folder where esbuild and three are. Says
// "skipped: ..." where they are not.
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
const [bundle] = buildSync({
  stdin: { contents: 'export { DenseView } from "./dense"; export { Vector3 } from "three";', resolveDir: join(web, "src"), loader: "ts" },
  bundle: true, write: false, format: "esm", nodePaths: [join(packages, "node_modules")],
}).outputFiles;
const { DenseView, Vector3 } = await import("data:text/javascript;base64," + Buffer.from(bundle.text).toString("base64"));

// One free cell of a metre on a floor that lies 1.5 m below the first camera, whose y points down.
const data = new DataView(new ArrayBuffer(4 + 52));
const quarter = Math.SQRT1_2;
for (const [i, value] of [1, -0.5, -0.5, -quarter, 0, 0, quarter, 0, 0, 1.5].entries()) data.setFloat32(4 + 4 * i, value, true);
data.setUint32(44, 1, true);
data.setUint32(48, 1, true);
data.setUint16(52, 1, true);
data.setUint16(54, 254, true);
const dense = new DenseView();
dense.takeGrid(data);

// Its corners are nearer to the eye than the floor's plane by more than a floor's surface is off it, on either side.
for (const [name, eye, y] of [["above", new Vector3(0, 0, 0), 1.45], ["below", new Vector3(0, 3, 0), 1.55]]) {
  dense.lookFrom(eye);
  const corners = dense.grid.geometry.getAttribute("position"), p = new Vector3();
  for (let i = 0; i < 4; i++)
    assert.ok(Math.abs(p.fromBufferAttribute(corners, i).applyMatrix4(dense.grid.matrix).y - y) < 1e-6, `from ${name}: ${p.y}, not ${y}`);
}
console.log("the grid does not lie in the floor's surface");
