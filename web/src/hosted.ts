// SPDX-License-Identifier: Apache-2.0
// Things that hang on keyframes: their vertices are in a keyframe's axes, and the shader brings them to the world by a
// texture of poses. A correction of the map changes that texture and nothing else.
import * as THREE from "three";

const perRow = 256;

const pose = `
uniform sampler2D poses;
vec3 inWorld(vec3 p, float host) {
  int h = int(host);
  ivec2 at = ivec2(3 * (h % ${perRow}), h / ${perRow});
  vec4 point = vec4(p, 1.0);
  return vec3(dot(texelFetch(poses, at, 0), point), dot(texelFetch(poses, at + ivec2(1, 0), 0), point),
              dot(texelFetch(poses, at + ivec2(2, 0), 0), point));
}
`;
const nowhere = "gl_Position = vec4(2.0, 2.0, 2.0, 1.0); gl_PointSize = 0.0;";

// Poses of all keyframes ever made, by id.
export class Poses {
  readonly known: boolean[] = [];
  private hidden: boolean[] = []; // by id: of maps that are not shown
  readonly uniform = { value: this.texture(1) };
  private goal: Float32Array = new Float32Array(perRow * 12);
  private start: Float32Array | null = null;
  private startTime = 0;

  private texture(rows: number, data = new Float32Array(perRow * 12 * rows)): THREE.DataTexture {
    const texture = new THREE.DataTexture(data, perRow * 3, rows, THREE.RGBAFormat, THREE.FloatType);
    texture.needsUpdate = true;
    return texture;
  }
  private get now(): Float32Array {
    return this.uniform.value.image.data as Float32Array;
  }
  clear(): void {
    this.known.length = this.hidden.length = 0;
    this.start = null;
  }
  // `q`: x y z w.
  set(id: number, q: number[], t: number[], shown: boolean): void {
    const rows = Math.floor(id / perRow) + 1;
    if (rows > this.goal.length / (perRow * 12)) {
      const grown = Math.max(rows, (2 * this.goal.length) / (perRow * 12));
      const larger = (old: Float32Array) => {
        const data = new Float32Array(perRow * 12 * grown);
        data.set(old);
        return data;
      };
      this.goal = larger(this.goal);
      this.start = this.start && larger(this.start);
      const data = larger(this.now);
      this.uniform.value.dispose();
      this.uniform.value = this.texture(grown, data);
    }
    const [x, y, z, w] = q;
    const m = [
      1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), t[0],
      2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), t[1],
      2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), t[2],
    ];
    this.goal.set(m, id * 12);
    const jumps = !this.known[id] || !shown || this.hidden[id];
    if (jumps || !this.start) this.now.set(shown ? m : outOfSight, id * 12);
    if (jumps && this.start) this.start.set(m, id * 12);
    this.known[id] = true;
    this.hidden[id] = !shown;
    this.uniform.value.needsUpdate = true;
  }
  // Shows some of all and puts the others out of sight, at once.
  show(shown: (id: number) => boolean): void {
    this.start = null;
    this.known.forEach((_known, id) => {
      this.hidden[id] = !shown(id);
      this.now.set(this.hidden[id] ? outOfSight : this.goal.subarray(id * 12, id * 12 + 12), id * 12);
    });
    this.uniform.value.needsUpdate = true;
  }
  shows(id: number): boolean {
    return !this.hidden[id];
  }
  // The poses set next are moved to, so that a correction can be seen.
  glide(): void {
    this.start = this.now.slice();
    this.startTime = performance.now();
  }
  // Whether it still moves.
  step(): boolean {
    if (!this.start) return false;
    const share = Math.min(1, (performance.now() - this.startTime) / 900);
    const s = share * share * (3 - 2 * share);
    const now = this.now;
    for (let i = 0; i < this.goal.length; i++)
      if (!this.hidden[Math.floor(i / 12)]) now[i] = this.start[i] + s * (this.goal[i] - this.start[i]);
    this.uniform.value.needsUpdate = true;
    if (share === 1) this.start = null;
    return true;
  }
  toWorld(id: number, p: [number, number, number], out: THREE.Vector3): THREE.Vector3 {
    const m = this.now, o = id * 12;
    return out.set(
      m[o] * p[0] + m[o + 1] * p[1] + m[o + 2] * p[2] + m[o + 3],
      m[o + 4] * p[0] + m[o + 5] * p[1] + m[o + 6] * p[2] + m[o + 7],
      m[o + 8] * p[0] + m[o + 9] * p[1] + m[o + 10] * p[2] + m[o + 11]);
  }
}

const outOfSight = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1e9]; // beyond what the view's camera draws, wherever a point lies

const blockBits = 13, blockSize = 1 << blockBits;

function bitsReversed(i: number): number {
  let r = 0;
  for (let b = 0; b < blockBits; b++) r |= ((i >> b) & 1) << (blockBits - 1 - b);
  return r;
}

// The cloud: blocks of 8192 points, one draw call each. Within a block, places are taken in an order whose every
// beginning is spread evenly, so that drawing a part of each block shows a coarser map.
export class Cloud {
  readonly group = new THREE.Group();
  readonly material: THREE.ShaderMaterial;
  private slots = new Map<number, number>(); // point -> place
  private free: number[] = [];
  private count = 0;
  private blocks: { position: THREE.BufferAttribute; host: THREE.BufferAttribute; colour: THREE.BufferAttribute; geometry: THREE.BufferGeometry }[] = [];

  constructor(private poses: Poses, private unit: number) {
    this.material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      uniforms: { poses: poses.uniform, unit: { value: unit }, size: { value: 1 }, lift: { value: 0 } },
      vertexShader: `in float host; in vec4 colour; uniform float unit; uniform float size; out vec3 shade;` + pose + `
        void main() {
          if (host < 0.0) { ${nowhere} return; }
          shade = colour.rgb;
          vec4 p = viewMatrix * vec4(inWorld(position * unit, host), 1.0);
          gl_Position = projectionMatrix * p;
          gl_PointSize = size * clamp(1.6 + 5.0 / max(0.1, -p.z), 2.0, 6.0);
        }`,
      // Dark points are lifted from a dark ground.
      fragmentShader: `in vec3 shade; uniform float lift; out vec4 color; void main() { color = vec4(mix(shade, vec3(1.0), lift), 1.0); }`,
    });
  }
  get points(): number {
    return this.slots.size;
  }
  get drawCalls(): number {
    return this.blocks.length;
  }
  private place(slot: number): [number, number] {
    return [slot >> blockBits, bitsReversed(slot & (blockSize - 1))];
  }
  private addBlock(): void {
    const geometry = new THREE.BufferGeometry();
    const position = new THREE.BufferAttribute(new Int16Array(3 * blockSize), 3);
    const host = new THREE.BufferAttribute(new Float32Array(blockSize).fill(-1), 1);
    const colour = new THREE.BufferAttribute(new Uint8Array(4 * blockSize), 4, true);
    for (const a of [position, host, colour]) a.setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute("position", position);
    geometry.setAttribute("host", host);
    geometry.setAttribute("colour", colour);
    const points = new THREE.Points(geometry, this.material);
    points.frustumCulled = false;
    this.group.add(points);
    this.blocks.push({ position, host, colour, geometry });
  }
  take(data: DataView): void {
    for (let at = 0; at < data.byteLength; ) {
      const host = data.getUint32(at, true), n = data.getUint32(at + 4, true);
      at += 8;
      for (let i = 0; i < n; i++, at += 12) {
        const id = host * 8192 + data.getUint16(at, true);
        let slot = this.slots.get(id);
        if (data.getUint8(at + 11) === 0) {
          if (slot === undefined) continue;
          const [b, v] = this.place(slot);
          this.blocks[b].host.array[v] = -1;
          this.blocks[b].host.needsUpdate = true;
          this.slots.delete(id);
          this.free.push(slot);
          continue;
        }
        if (slot === undefined) {
          slot = this.free.pop() ?? this.count++;
          this.slots.set(id, slot);
        }
        const [b, v] = this.place(slot);
        if (b >= this.blocks.length) this.addBlock();
        const block = this.blocks[b];
        for (let k = 0; k < 3; k++) {
          block.position.array[3 * v + k] = data.getInt16(at + 2 + 2 * k, true);
          block.colour.array[4 * v + k] = data.getUint8(at + 8 + k);
        }
        block.host.array[v] = host;
        block.position.needsUpdate = block.host.needsUpdate = block.colour.needsUpdate = true;
      }
    }
  }
  // Of all points about `budget` are drawn.
  draw(budget: number): void {
    const share = Math.min(1, budget / Math.max(1, this.count));
    for (const b of this.blocks) b.geometry.setDrawRange(0, Math.ceil(blockSize * share));
  }
  // The point nearest to a place on the screen (-1 ... 1), in front of the camera; null when none is near.
  pick(x: number, y: number, camera: THREE.PerspectiveCamera): THREE.Vector3 | null {
    const world = new THREE.Vector3(), seen = new THREE.Vector3();
    let best: THREE.Vector3 | null = null, least = Infinity;
    for (const slot of this.slots.values()) {
      const [b, v] = this.place(slot);
      const { position, host } = this.blocks[b];
      const p = position.array, u = this.unit;
      if (!this.poses.shows(host.array[v])) continue;
      this.poses.toWorld(host.array[v], [p[3 * v] * u, p[3 * v + 1] * u, p[3 * v + 2] * u], world);
      seen.copy(world).project(camera);
      if (seen.z > 1 || seen.z < -1) continue;
      const far = Math.hypot((seen.x - x) * camera.aspect, seen.y - y);
      if (far > 0.05) continue;
      const cost = far + 0.02 * world.distanceTo(camera.position) / 10;
      if (cost < least) {
        least = cost;
        best = world.clone();
      }
    }
    return best;
  }
  // Where most of it is: the middle of a sample, and the distance that nine of ten points are within.
  middle(): { at: THREE.Vector3; radius: number } | null {
    const sample: THREE.Vector3[] = [], u = this.unit;
    for (const slot of this.slots.values()) {
      if (slot % 17 !== 0) continue;
      const [b, v] = this.place(slot);
      if (!this.poses.shows(this.blocks[b].host.array[v])) continue;
      const a = this.blocks[b].position.array;
      sample.push(this.poses.toWorld(this.blocks[b].host.array[v], [a[3 * v] * u, a[3 * v + 1] * u, a[3 * v + 2] * u], new THREE.Vector3()));
    }
    if (sample.length === 0) return null;
    const at = sample.reduce((sum, p) => sum.add(p), new THREE.Vector3()).divideScalar(sample.length);
    const far = sample.map((p) => p.distanceTo(at)).sort((p, q) => p - q);
    return { at, radius: far[Math.floor(0.9 * (far.length - 1))] };
  }
  dispose(): void {
    for (const b of this.blocks) b.geometry.dispose();
    this.material.dispose();
  }
}

// Lines between places in keyframes' axes.
export class HostedLines {
  readonly object: THREE.LineSegments;
  private used = 0;
  private position: THREE.BufferAttribute;
  private host: THREE.BufferAttribute;

  constructor(poses: Poses, colour: string, opacity = 1) {
    const material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      transparent: opacity < 1,
      depthWrite: opacity === 1,
      uniforms: { poses: poses.uniform, colour: { value: new THREE.Color(colour) }, opacity: { value: opacity } },
      vertexShader: `in float host;` + pose + `
        void main() { gl_Position = projectionMatrix * viewMatrix * vec4(inWorld(position, host), 1.0); }`,
      fragmentShader: `uniform vec3 colour; uniform float opacity; out vec4 color; void main() { color = vec4(colour, opacity); }`,
    });
    this.position = new THREE.BufferAttribute(new Float32Array(0), 3);
    this.host = new THREE.BufferAttribute(new Float32Array(0), 1);
    this.object = new THREE.LineSegments(new THREE.BufferGeometry(), material);
    this.object.frustumCulled = false;
    this.grow(1024);
  }
  private grow(vertices: number): void {
    const grown = (old: THREE.BufferAttribute) => {
      const data = new Float32Array(vertices * old.itemSize);
      data.set(old.array as Float32Array);
      return new THREE.BufferAttribute(data, old.itemSize).setUsage(THREE.DynamicDrawUsage);
    };
    this.position = grown(this.position);
    this.host = grown(this.host);
    this.object.geometry.dispose();
    const geometry = (this.object.geometry = new THREE.BufferGeometry());
    geometry.setAttribute("position", this.position);
    geometry.setAttribute("host", this.host);
    geometry.setDrawRange(0, this.used);
  }
  set colour(c: string) {
    (this.object.material as THREE.ShaderMaterial).uniforms.colour.value.set(c);
  }
  clear(): void {
    this.used = 0;
    this.object.geometry.setDrawRange(0, 0);
  }
  add(hostA: number, a: ArrayLike<number>, hostB: number, b: ArrayLike<number>): void {
    if (this.used + 2 > this.host.count) this.grow(2 * this.host.count);
    this.position.array.set([a[0], a[1], a[2], b[0], b[1], b[2]], 3 * this.used);
    this.host.array.set([hostA, hostB], this.used);
    this.used += 2;
    this.position.needsUpdate = this.host.needsUpdate = true;
    this.object.geometry.setDrawRange(0, this.used);
  }
}
