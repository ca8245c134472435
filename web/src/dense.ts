// SPDX-License-Identifier: Apache-2.0
// The dense map: the surface of the still world, and the grid of where a robot can drive.
import * as THREE from "three";

export function matrixOf(pose: number[]): THREE.Matrix4 {
  return new THREE.Matrix4().compose(new THREE.Vector3(pose[4], pose[5], pose[6]),
    new THREE.Quaternion(pose[0], pose[1], pose[2], pose[3]), new THREE.Vector3(1, 1, 1));
}

// [m] The floor's surface lies up to 3 cm off its plane (src/dkb/dense/floor_plane.cpp), obstacles begin above this: the
// grid is drawn so much nearer, on the side it is seen from, or the two would cover each other in stripes.
const kLift = 0.05;

export class DenseView {
  readonly surface = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide }));
  readonly grid = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ transparent: true, side: THREE.DoubleSide, depthWrite: false }));
  private roots = { surface: -1, grid: -1 }; // of the maps that they are of
  private worldFromFloor = new THREE.Matrix4();

  constructor() {
    this.surface.visible = this.grid.visible = this.grid.matrixAutoUpdate = false;
  }
  // What lay in the world before is not to be shown in this one.
  begin(): void {
    for (const dense of [this.surface, this.grid]) {
      dense.geometry.dispose();
      dense.geometry = new THREE.BufferGeometry();
      dense.visible = false;
    }
  }
  // Whether there is one, and of a map that is shown.
  shows(what: "surface" | "grid", isShown: (root: number) => boolean): boolean {
    return this[what].geometry.index !== null && isShown(this.roots[what]);
  }
  // The surface, in the world.
  takeSurface(message: DataView): void {
    this.roots.surface = message.getInt32(0, true);
    const data = new DataView(message.buffer, message.byteOffset + 4, message.byteLength - 4);
    const middle = [0, 4, 8].map((at) => data.getFloat32(at, true)), unit = data.getFloat32(12, true);
    const n = data.getUint32(16, true), triangles = data.getUint32(20, true);
    const position = new Float32Array(3 * n), colour = new Uint8Array(4 * n), index = new Uint16Array(3 * triangles);
    for (let i = 0; i < 3 * n; i++) position[i] = middle[i % 3] + unit * data.getInt16(24 + 2 * i, true);
    let at = 24 + 4 * Math.ceil((6 * n) / 4);
    colour.set(new Uint8Array(data.buffer, data.byteOffset + at, 4 * n));
    at += 4 * n;
    for (let i = 0; i < 3 * triangles; i++) index[i] = data.getUint16(at + 2 * i, true);
    this.surface.geometry.dispose();
    const geometry = (this.surface.geometry = new THREE.BufferGeometry());
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colour, 4, true));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
  }
  // Where a robot can drive, on the floor: free is green, occupied orange, unknown nothing.
  takeGrid(message: DataView): void {
    this.roots.grid = message.getInt32(0, true);
    const data = new DataView(message.buffer, message.byteOffset + 4, message.byteLength - 4);
    const f = (i: number) => data.getFloat32(4 * i, true);
    const [cell, x, y] = [f(0), f(1), f(2)], w = data.getUint32(40, true), h = data.getUint32(44, true);
    const pixels = new Uint8Array(4 * w * h);
    for (let at = 48, i = 0; at + 4 <= data.byteLength; at += 4) {
      const end = Math.min(w * h, i + data.getUint16(at, true)), value = data.getUint16(at + 2, true);
      for (; i < end; i++) pixels.set(value === 0 ? [230, 110, 0, 230] : value === 254 ? [0, 158, 115, 90] : [0, 0, 0, 0], 4 * i);
    }
    this.grid.material.map?.dispose();
    const texture = (this.grid.material.map = new THREE.DataTexture(pixels, w, h));
    texture.needsUpdate = this.grid.material.needsUpdate = true;
    this.grid.geometry.dispose();
    const geometry = (this.grid.geometry = new THREE.BufferGeometry());
    const [right, top] = [x + w * cell, y + h * cell];
    geometry.setAttribute("position", new THREE.Float32BufferAttribute([x, y, 0, right, y, 0, right, top, 0, x, top, 0], 3));
    geometry.setAttribute("uv", new THREE.Float32BufferAttribute([0, 1, 1, 1, 1, 0, 0, 0], 2)); // the first row is the top
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this.worldFromFloor.copy(matrixOf([f(3), f(4), f(5), f(6), f(7), f(8), f(9)]).invert());
  }
  // `eye`: from where it is looked at, in the world.
  lookFrom(eye: THREE.Vector3): void {
    const above = eye.clone().applyMatrix4(this.worldFromFloor.clone().invert()).z > 0;
    this.grid.matrix.makeTranslation(0, 0, above ? kLift : -kLift).premultiply(this.worldFromFloor);
    this.grid.matrixWorldNeedsUpdate = true;
  }
}
