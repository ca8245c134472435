// SPDX-License-Identifier: Apache-2.0
// The 3-D view.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { Cloud, HostedLines, Poses } from "./hosted";

export type Mover = { id: number; class: string; position: number[]; velocity: number[]; size: number[]; box: number[] };
export type Hello = {
  version: string; source: string; realtime: boolean; budget_ms: number; unit: number; feature_unit?: number;
  camera: { width: number; height: number; fx: number; fy: number; cx: number; cy: number };
};
export type Mode = "follow" | "free" | "top";
export const layers = ["points", "keyframes", "covisibility", "path", "movers", "truth", "loops", "surface", "grid"] as const;
export type Layer = (typeof layers)[number];

const kFrustum = 0.06; // [m] depth of a keyframe's drawn frustum
const kCross = 0.06; // [m] half the size of a mark

type Palette = { keyframe: string; covisibility: string; path: string; loop: string; truth: string; camera: string; mover: string };

// Without a GPU every sample of a pixel costs as much as a pixel.
function drawnByProcessor(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class View {
  readonly renderer: THREE.WebGLRenderer;
  readonly camera = new THREE.PerspectiveCamera(60, 1, 0.02, 500);
  readonly controls: OrbitControls;
  mode: Mode = "follow";
  onMode: () => void = () => {};
  onLead: () => void = () => {}; // a visitor turns this one
  leader: View | null = null; // looks at what that one looks at
  onMeasure: (text: string) => void = () => {};
  private scene = new THREE.Scene();
  private poses = new Poses();
  private cloud = new Cloud(this.poses, 0.001);
  private keyframes!: HostedLines;
  private covisibility!: HostedLines;
  private path!: HostedLines;
  private loops!: HostedLines;
  private truth = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
  private frustum = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
  private movers = new THREE.Group();
  // What is drawn of movers and marks is made once: what WebGL holds goes only when it is disposed of.
  private moverBox = new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1));
  private moverMaterial = new THREE.LineBasicMaterial();
  private moverShapes: { box: THREE.LineSegments; arrow: THREE.ArrowHelper }[] = [];
  private markCross = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap((axis) => [...axis.map((x) => -kCross * x), ...axis.map((x) => kCross * x)]), 3));
  private markMaterial = new THREE.LineBasicMaterial({ depthTest: false });
  private markLine = new THREE.Line(new THREE.BufferGeometry(), this.markMaterial);
  private surface = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide }));
  private grid = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ transparent: true, side: THREE.DoubleSide, depthWrite: false }));
  private marker = new THREE.Group();
  private labels: HTMLDivElement[] = [];
  private known = new Map<number, { frame: number; culled: boolean }>();
  private edges = new Map<number, number[]>();
  private pathFrames: { frame: number; host: number; p: [number, number, number] }[] = [];
  private lastPath: { host: number; p: number[] } | null = null;
  private staleKeyframes = false;
  private staleEdges = false;
  private cameraPose: THREE.Matrix4 | null = null;
  private measured: THREE.Vector3[] = [];
  private whole: { at: THREE.Vector3; radius: number } | null = null; // the map, once the run has ended
  private dirty = true;
  private aligned = false; // the truth, with this world
  private lastDrawn = 0;
  private movedAt = 0;
  private coarse = false; // what is seen is not the whole map
  private budget = 200000; // points drawn while moving
  private moverList: Mover[] = [];
  private still = matchMedia("(prefers-reduced-motion: reduce)");
  private hello: Hello | null = null;

  constructor(private canvas: HTMLCanvasElement, private overlay: HTMLElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !drawnByProcessor() });
    this.camera.up.set(0, -1, 0); // the world's y is down
    this.camera.position.set(1.2, -2, -3);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(0, 0, 1);
    this.controls.enableDamping = !this.still.matches;
    this.controls.addEventListener("start", () => {
      this.onLead();
      this.setMode("free");
    });
    this.controls.addEventListener("change", () => {
      this.movedAt = performance.now();
      this.dirty = true;
    });
    this.keyframes = new HostedLines(this.poses, "#888");
    this.covisibility = new HostedLines(this.poses, "#888", 0.35);
    this.path = new HostedLines(this.poses, "#888");
    this.loops = new HostedLines(this.poses, "#888");
    this.frustum.frustumCulled = this.truth.frustumCulled = this.markLine.frustumCulled = false;
    this.frustum.visible = false;
    this.truth.matrixAutoUpdate = this.frustum.matrixAutoUpdate = false;
    this.truth.visible = false;
    this.scene.add(this.cloud.group, this.keyframes.object, this.covisibility.object, this.path.object,
      this.loops.object, this.truth, this.frustum, this.movers, this.marker, this.surface, this.grid);
    this.surface.visible = this.grid.visible = this.grid.matrixAutoUpdate = false;
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    const loop = () => {
      requestAnimationFrame(loop);
      this.draw();
    };
    loop();
  }

  // --- what the stream tells
  begin(hello: Hello): void {
    this.hello = hello;
    this.poses.clear();
    this.scene.remove(this.cloud.group);
    const shown = this.cloud.group.visible;
    this.cloud.dispose();
    this.cloud = new Cloud(this.poses, hello.unit);
    this.cloud.group.visible = shown;
    this.scene.add(this.cloud.group);
    for (const lines of [this.keyframes, this.covisibility, this.path, this.loops]) lines.clear();
    this.known.clear();
    this.edges.clear();
    this.clearPath();
    // What lay in the world before, or was laid on it, is not to be shown in this one.
    for (const dense of [this.surface, this.grid]) {
      dense.geometry.dispose();
      dense.geometry = new THREE.BufferGeometry();
    }
    this.aligned = false;
    this.truth.visible = this.surface.visible = this.grid.visible = this.frustum.visible = false;
    this.cameraPose = this.whole = null;
    this.endMeasure();
    const c = hello.camera, z = 0.16;
    const corner = (x: number, y: number) => [((x - c.cx) / c.fx) * z, ((y - c.cy) / c.fy) * z, z];
    const corners = [corner(0, 0), corner(c.width, 0), corner(c.width, c.height), corner(0, c.height)];
    const lines: number[] = [];
    for (let i = 0; i < 4; i++) lines.push(0, 0, 0, ...corners[i], ...corners[i], ...corners[(i + 1) % 4]);
    this.frustum.geometry.setAttribute("position", new THREE.Float32BufferAttribute(lines, 3));
    this.dirty = true;
  }
  takeKeyframes(data: DataView): void {
    const list: { id: number; q: number[]; t: number[] }[] = [];
    let moved = 0;
    for (let at = 0; at < data.byteLength; at += 44) {
      const f = (i: number) => data.getFloat32(at + 16 + 4 * i, true);
      const id = data.getInt32(at, true);
      if (this.known.has(id)) moved++;
      const culled = data.getUint32(at + 12, true) === 1;
      const before = this.known.get(id);
      if (!before || before.culled !== culled) this.staleKeyframes = this.staleEdges = true;
      this.known.set(id, { frame: data.getInt32(at + 4, true), culled });
      list.push({ id, q: [f(0), f(1), f(2), f(3)], t: [f(4), f(5), f(6)] });
    }
    // Local adjustment moves a few keyframes a little; more than a dozen at once is a correction of the map.
    if (moved > 12 && !this.still.matches) this.poses.glide();
    for (const k of list) this.poses.set(k.id, k.q, k.t);
    this.dirty = true;
  }
  takePoints(data: DataView): void {
    this.cloud.take(data);
    this.dirty = true;
  }
  takeCovisibility(data: DataView): void {
    for (let at = 0; at < data.byteLength; ) {
      const id = data.getUint32(at, true), n = data.getUint32(at + 4, true);
      const others: number[] = [];
      for (let i = 0; i < n; i++) others.push(data.getUint32(at + 8 + 8 * i, true));
      this.edges.set(id, others);
      at += 8 + 8 * n;
    }
    this.staleEdges = true;
    this.dirty = true;
  }
  takeLoops(data: DataView): void {
    this.loops.clear();
    for (let at = 0; at < data.byteLength; at += 12)
      this.loops.add(data.getInt32(at, true), [0, 0, 0], data.getInt32(at + 4, true), [0, 0, 0]);
    this.dirty = true;
  }
  clearPath(): void {
    this.path.clear();
    this.pathFrames = [];
    this.lastPath = null;
  }
  takePath(data: DataView): void {
    for (let at = 0; at < data.byteLength; at += 20) {
      const host = data.getInt32(at + 4, true);
      if (host < 0) {
        this.lastPath = null;
        continue;
      }
      const p: [number, number, number] = [data.getFloat32(at + 8, true), data.getFloat32(at + 12, true), data.getFloat32(at + 16, true)];
      if (this.lastPath) this.path.add(this.lastPath.host, this.lastPath.p, host, p);
      this.lastPath = { host, p };
      this.pathFrames.push({ frame: data.getUint32(at, true), host, p });
    }
    this.dirty = true;
  }
  takeTruth(data: DataView): void {
    const points: number[] = [];
    for (let at = 0; at < data.byteLength; at += 16)
      for (let k = 1; k < 4; k++) points.push(data.getFloat32(at + 4 * k, true));
    this.truth.geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  }
  // The dense map's surface, in the world.
  takeSurface(data: DataView): void {
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
    this.surface.visible = !this.hidden.has("surface");
    this.dirty = true;
  }
  // Where a robot can drive, on the floor: free is green, occupied orange, unknown nothing.
  takeGrid(data: DataView): void {
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
    this.grid.matrix.copy(this.matrix([f(3), f(4), f(5), f(6), f(7), f(8), f(9)]).invert());
    this.grid.visible = !this.hidden.has("grid");
    this.dirty = true;
  }
  private matrix(pose: number[]): THREE.Matrix4 {
    return new THREE.Matrix4().compose(new THREE.Vector3(pose[4], pose[5], pose[6]),
      new THREE.Quaternion(pose[0], pose[1], pose[2], pose[3]), new THREE.Vector3(1, 1, 1));
  }
  takeFrame(camera: number[] | undefined, movers: Mover[], worldFromTruth: number[] | undefined): void {
    this.frustum.visible = camera !== undefined;
    if (camera) {
      this.cameraPose = this.matrix(camera);
      this.frustum.matrix.copy(this.cameraPose);
    }
    if (worldFromTruth) {
      this.truth.matrix.copy(this.matrix(worldFromTruth));
      this.aligned = true;
      this.truth.visible = !this.hidden.has("truth");
    } else {
      // Not yet laid on the map that the camera is in now.
      this.aligned = this.truth.visible = false;
    }
    this.moverList = movers;
    movers.forEach((m, i) => {
      const { box, arrow } = (this.moverShapes[i] ??= this.moverShape());
      box.visible = true;
      box.position.fromArray(m.position);
      box.scale.fromArray(m.size.map((s) => Math.max(0.1, s)));
      if (this.cameraPose) box.quaternion.setFromRotationMatrix(this.cameraPose);
      const v = new THREE.Vector3().fromArray(m.velocity), speed = v.length();
      arrow.visible = speed > 0.05;
      if (!arrow.visible) return;
      arrow.position.copy(box.position);
      arrow.setDirection(v.divideScalar(speed));
      arrow.setLength(speed, 0.15, 0.08);
    });
    for (const { box, arrow } of this.moverShapes.slice(movers.length)) box.visible = arrow.visible = false;
    this.dirty = true;
  }
  private moverShape(): { box: THREE.LineSegments; arrow: THREE.ArrowHelper } {
    const box = new THREE.LineSegments(this.moverBox, this.moverMaterial), arrow = new THREE.ArrowHelper();
    arrow.setColor(this.palette.mover);
    this.movers.add(box, arrow);
    return { box, arrow };
  }

  // --- what the visitor asks for
  private hidden = new Set<Layer>();
  show(layer: Layer, on: boolean): void {
    if (on) this.hidden.delete(layer);
    else this.hidden.add(layer);
    const objects: Record<Layer, THREE.Object3D> = {
      points: this.cloud.group, keyframes: this.keyframes.object, covisibility: this.covisibility.object,
      path: this.path.object, movers: this.movers, truth: this.truth, loops: this.loops.object, surface: this.surface, grid: this.grid,
    };
    const dense = layer === "surface" || layer === "grid";
    const empty = dense ? !(objects[layer] as THREE.Mesh).geometry.index : layer === "truth" && !this.aligned;
    objects[layer].visible = on && !empty;
    this.dirty = true;
  }
  setMode(mode: Mode): void {
    if (mode === "top") {
      const { at, radius } = this.cloud.middle() ?? { at: new THREE.Vector3(0, 0, 1), radius: 1 };
      const p = new THREE.Vector3();
      const far = this.pathFrames.reduce((r, f) => Math.max(r, this.poses.toWorld(f.host, f.p, p).distanceTo(at)), radius);
      const away = 2 * Math.max(0.5, far);
      this.controls.target.copy(at);
      this.camera.position.set(at.x, at.y - away, at.z - 0.01 * away);
      this.controls.update();
    }
    if (mode === this.mode) return;
    this.mode = mode;
    this.dirty = true;
    this.onMode();
  }
  // The run has ended: there is nobody to follow any more, so the whole map comes into view.
  end(): void {
    this.whole ??= this.cloud.middle();
  }
  // Shows where the camera was at a frame.
  jumpTo(frame: number): void {
    let best: (typeof this.pathFrames)[number] | null = null;
    for (const p of this.pathFrames) if (!best || Math.abs(p.frame - frame) < Math.abs(best.frame - frame)) best = p;
    if (!best) return;
    const at = this.poses.toWorld(best.host, best.p, new THREE.Vector3());
    const away = this.camera.position.clone().sub(this.controls.target).setLength(1.8);
    this.controls.target.copy(at);
    this.camera.position.copy(at).add(away);
    this.setMode("free");
    this.controls.update();
    this.mark([at]);
  }
  private mark(points: THREE.Vector3[]): void {
    this.marker.clear();
    for (const p of points) {
      const lines = new THREE.LineSegments(this.markCross, this.markMaterial);
      lines.position.copy(p);
      this.marker.add(lines);
    }
    if (points.length === 2) {
      this.markLine.geometry.setFromPoints(points);
      this.marker.add(this.markLine);
    }
    this.dirty = true;
  }
  // A point for the measure, at a place of the screen (-1 ... 1).
  measureAt(x: number, y: number): void {
    const p = this.cloud.pick(x, y, this.camera);
    if (!p) return this.onMeasure("no point there");
    if (this.measured.length === 2) this.measured = [];
    this.measured.push(p);
    this.mark(this.measured);
    this.onMeasure(this.measured.length === 2
      ? `${this.measured[0].distanceTo(this.measured[1]).toFixed(3)} m` : "now the second point");
  }
  endMeasure(): void {
    this.measured = [];
    this.mark([]);
  }
  // The camera turned, moved or brought nearer, by keys.
  turn(across: number, down: number): void {
    this.onLead();
    this.setMode("free");
    const away = this.camera.position.clone().sub(this.controls.target);
    away.applyAxisAngle(this.camera.up, -across);
    const side = new THREE.Vector3().crossVectors(this.camera.up, away).normalize();
    const turned = away.clone().applyAxisAngle(side, down);
    const angle = turned.angleTo(this.camera.up);
    if (angle > 0.05 && angle < Math.PI - 0.05) away.copy(turned);
    this.camera.position.copy(this.controls.target).add(away);
    this.controls.update();
  }
  nearer(factor: number): void {
    this.onLead();
    this.setMode("free");
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.controls.update();
  }
  picture(done: (blob: Blob) => void): void {
    this.render(Infinity);
    this.canvas.toBlob((blob) => blob && done(blob));
  }

  // --- drawing
  private palette: Palette = { keyframe: "", covisibility: "", path: "", loop: "", truth: "", camera: "", mover: "" };
  paint(): void {
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    this.palette = {
      keyframe: colour("--keyframe"), covisibility: colour("--covisibility"), path: colour("--path"), loop: colour("--loop"),
      truth: colour("--truth"), camera: colour("--camera"), mover: colour("--mover"),
    };
    this.scene.background = new THREE.Color(colour("--view"));
    this.keyframes.colour = this.palette.keyframe;
    this.covisibility.colour = this.palette.covisibility;
    this.path.colour = this.palette.path;
    this.loops.colour = this.palette.loop;
    this.truth.material.color.set(this.palette.truth);
    this.frustum.material.color.set(this.palette.camera);
    this.moverMaterial.color.set(this.palette.mover);
    this.markMaterial.color.set(this.palette.loop);
    for (const { arrow } of this.moverShapes) arrow.setColor(this.palette.mover);
    this.dirty = true;
  }
  private resize(): void {
    const box = this.canvas.parentElement!.getBoundingClientRect();
    if (box.width < 1 || box.height < 1) return;
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.renderer.setSize(box.width, box.height, false);
    this.camera.aspect = box.width / box.height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }
  private rebuild(): void {
    if (this.staleKeyframes) {
      this.keyframes.clear();
      const c = this.hello?.camera ?? { width: 640, height: 480, fx: 525, fy: 525, cx: 320, cy: 240 };
      const x = (kFrustum * c.cx) / c.fx, y = (kFrustum * c.cy) / c.fy;
      const corners = [[-x, -y, kFrustum], [x, -y, kFrustum], [x, y, kFrustum], [-x, y, kFrustum]];
      for (const [id, k] of this.known) {
        if (k.culled) continue;
        for (let i = 0; i < 4; i++) {
          this.keyframes.add(id, [0, 0, 0], id, corners[i]);
          this.keyframes.add(id, corners[i], id, corners[(i + 1) % 4]);
        }
      }
    }
    if (this.staleEdges) {
      this.covisibility.clear();
      for (const [id, others] of this.edges) {
        if (this.known.get(id)?.culled) continue;
        for (const other of others)
          if (this.known.get(other)?.culled === false) this.covisibility.add(id, [0, 0, 0], other, [0, 0, 0]);
      }
    }
    this.staleKeyframes = this.staleEdges = false;
  }
  private copyLeader(): void {
    const { camera, controls } = this.leader!;
    if (this.camera.position.equals(camera.position) && this.controls.target.equals(controls.target)) return;
    this.camera.position.copy(camera.position);
    this.camera.quaternion.copy(camera.quaternion);
    this.controls.target.copy(controls.target);
    this.movedAt = performance.now();
    this.dirty = true;
  }
  private follow(): void {
    if (this.mode !== "follow" || !this.cameraPose) return;
    const at = new THREE.Vector3(0, 0, 1.0).applyMatrix4(this.cameraPose);
    const behind = new THREE.Vector3(0, -0.8, -1.6).applyMatrix4(this.cameraPose);
    if (this.whole) {
      behind.sub(at).setLength(2 * Math.max(0.5, this.whole.radius)).add(this.whole.at);
      at.copy(this.whole.at);
    }
    const share = this.still.matches ? 1 : this.whole ? 0.03 : 0.12; // the whole map comes within two seconds
    if (behind.distanceTo(this.camera.position) + at.distanceTo(this.controls.target) < 1e-3) return;
    this.camera.position.lerp(behind, share);
    this.controls.target.lerp(at, share);
    this.dirty = true;
  }
  private draw(): void {
    const now = performance.now();
    if (now - this.lastDrawn < 15) return;
    if (this.leader) this.copyLeader();
    else {
      this.follow();
      this.controls.update();
    }
    if (this.poses.step()) this.dirty = true;
    const moving = now - this.movedAt < 250;
    if (!this.dirty && (moving || !this.coarse)) return;
    const interval = now - this.lastDrawn;
    this.lastDrawn = now;
    this.dirty = false;
    this.coarse = moving && this.cloud.points > this.budget;
    this.render(moving ? this.budget : Infinity);
    // A coarser map where the machine does not keep up, a finer one where it does.
    if (moving && interval > 31 && interval < 500) this.budget = Math.max(10000, this.budget * 0.9);
    if (moving && interval < 22) this.budget = Math.min(4e6, this.budget * 1.03);
  }
  private render(points: number): void {
    this.rebuild();
    this.cloud.material.uniforms.size.value = this.renderer.getPixelRatio();
    this.cloud.material.uniforms.lift.value = document.documentElement.dataset.theme === "dark" ? 0.18 : 0;
    this.cloud.draw(points);
    this.renderer.render(this.scene, this.camera);
    this.label();
    const data = this.canvas.dataset;
    data.points = String(this.cloud.points);
    data.cloudCalls = String(this.cloud.drawCalls);
    data.calls = String(this.renderer.info.render.calls);
    data.geometries = String(this.renderer.info.memory.geometries);
    data.look = this.camera.position.toArray().map((x) => x.toFixed(3)).join(" ");
    data.surface = String(this.surface.visible);
    data.truth = String(this.truth.visible);
    data.drawn = String(Number(data.drawn ?? 0) + 1);
  }
  private label(): void {
    const box = this.canvas.parentElement!.getBoundingClientRect();
    let used = 0;
    const p = new THREE.Vector3();
    if (!this.hidden.has("movers"))
      for (const m of this.moverList) {
        p.fromArray(m.position);
        p.y -= m.size[1] / 2;
        p.project(this.camera);
        if (p.z > 1 || Math.abs(p.x) > 1 || Math.abs(p.y) > 1) continue;
        let label = this.labels[used];
        if (!label) {
          label = document.createElement("div");
          label.className = "label";
          this.overlay.appendChild(label);
          this.labels.push(label);
        }
        const speed = Math.hypot(...m.velocity);
        label.textContent = `${m.class} ${m.id}  ${speed.toFixed(1)} m/s`;
        label.style.transform = `translate(${((p.x + 1) / 2) * box.width}px, ${((1 - p.y) / 2) * box.height}px) translate(-50%, -110%)`;
        label.hidden = false;
        used++;
      }
    for (let i = used; i < this.labels.length; i++) this.labels[i].hidden = true;
  }
}
