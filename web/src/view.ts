// SPDX-License-Identifier: Apache-2.0
// The 3-D view.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { DenseView, matrixOf } from "./dense";
import { Cloud, HostedLines, Poses } from "./hosted";
import { Maps } from "./maps";
import { MoverView, type Mover } from "./movers";

export type Hello = {
  protocol: number; source: string; budget_ms: number; unit: number; feature_unit: number;
  camera: { width: number; height: number; fx: number; fy: number; cx: number; cy: number };
};
export type Mode = "follow" | "free" | "top";
export const layers = ["points", "keyframes", "covisibility", "path", "movers", "truth", "loops", "surface", "grid"] as const;
export type Layer = (typeof layers)[number];

const kFrustum = 0.06; // [m] depth of a keyframe's drawn frustum
const kCross = 0.06; // [m] half the size of a mark

type Palette = { keyframe: string; covisibility: string; path: string; loop: string; truth: string; camera: string };

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
  onMaps: (words: string) => void = () => {}; // which of the maps that are not joined is shown
  private scene = new THREE.Scene();
  private poses = new Poses();
  private cloud = new Cloud(this.poses, 0.001);
  private keyframes!: HostedLines;
  private covisibility!: HostedLines;
  private path!: HostedLines;
  private loops!: HostedLines;
  private truth = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
  private frustum = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
  private movers: MoverView;
  private dense = new DenseView();
  // Marks are made once: what WebGL holds goes only when it is disposed of.
  private markCross = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap((axis) => [...axis.map((x) => -kCross * x), ...axis.map((x) => kCross * x)]), 3));
  private markMaterial = new THREE.LineBasicMaterial({ depthTest: false });
  private markLine = new THREE.Line(new THREE.BufferGeometry(), this.markMaterial);
  private marker = new THREE.Group();
  private maps = new Maps();
  private shownRoot = -1;
  private tracked = false; // the camera has a pose
  private over = false; // the run has ended
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
  private drawn = { position: new THREE.Vector3(), quaternion: new THREE.Quaternion(), target: new THREE.Vector3() }; // from where
  private coarse = false; // what is seen is not the whole map
  private budget = 200000; // points drawn while moving
  private still = matchMedia("(prefers-reduced-motion: reduce)");
  private hello: Hello | null = null;

  constructor(private canvas: HTMLCanvasElement, overlay: HTMLElement) {
    this.movers = new MoverView(overlay);
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
      this.loops.object, this.truth, this.frustum, this.movers.group, this.marker, this.dense.surface, this.dense.grid);
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
    this.cloud.dispose();
    this.cloud = new Cloud(this.poses, hello.unit);
    this.scene.add(this.cloud.group);
    for (const lines of [this.keyframes, this.covisibility, this.path, this.loops]) lines.clear();
    this.maps.clear();
    this.shownRoot = -1;
    this.edges.clear();
    this.clearPath();
    // What lay in the world before, or was laid on it, is not to be shown in this one.
    this.dense.begin();
    this.aligned = this.tracked = this.over = false;
    this.cameraPose = this.whole = null;
    this.endMeasure();
    const c = hello.camera, z = 0.16;
    const corner = (x: number, y: number) => [((x - c.cx) / c.fx) * z, ((y - c.cy) / c.fy) * z, z];
    const corners = [corner(0, 0), corner(c.width, 0), corner(c.width, c.height), corner(0, c.height)];
    const lines: number[] = [];
    for (let i = 0; i < 4; i++) lines.push(0, 0, 0, ...corners[i], ...corners[i], ...corners[(i + 1) % 4]);
    this.frustum.geometry.setAttribute("position", new THREE.Float32BufferAttribute(lines, 3));
    this.showMap();
    this.showLayers();
  }
  takeKeyframes(data: DataView): void {
    const list: { id: number; q: number[]; t: number[] }[] = [];
    let moved = 0;
    for (let at = 0; at < data.byteLength; at += 40) {
      const f = (i: number) => data.getFloat32(at + 12 + 4 * i, true);
      const id = data.getInt32(at, true);
      if (this.maps.has(id)) moved++;
      if (this.maps.take(id, data.getInt32(at + 4, true), data.getUint32(at + 8, true) === 1)) this.staleKeyframes = this.staleEdges = true;
      list.push({ id, q: [f(0), f(1), f(2), f(3)], t: [f(4), f(5), f(6)] });
    }
    // Local adjustment moves a few keyframes a little; more than a dozen at once is a correction of the map.
    if (moved > 12 && !this.still.matches) this.poses.glide();
    for (const k of list) this.poses.set(k.id, k.q, k.t, this.maps.shows(k.id));
    this.showMap();
    this.dirty = true;
  }
  // One map is shown, at once; without a way there, since how it lies to the others is not known.
  private showMap(): void {
    this.onMaps(this.maps.words);
    if (this.maps.shown === this.shownRoot) return;
    this.shownRoot = this.maps.shown;
    this.poses.show((id) => this.maps.shows(id));
    if (this.over) this.whole = this.cloud.middle();
    this.endMeasure();
    this.showLayers();
  }
  takePoints(data: DataView): void {
    this.cloud.take(data);
    this.dirty = true;
  }
  takeCovisibility(data: DataView): void {
    for (let at = 0; at < data.byteLength; ) {
      const id = data.getUint32(at, true), n = data.getUint32(at + 4, true);
      const others: number[] = [];
      for (let i = 0; i < n; i++) others.push(data.getUint32(at + 8 + 4 * i, true));
      this.edges.set(id, others);
      at += 8 + 4 * n;
    }
    this.staleEdges = true;
    this.dirty = true;
  }
  takeLoops(data: DataView): void {
    this.loops.clear();
    for (let at = 0; at < data.byteLength; at += 8)
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
      if (this.lastPath && this.maps.root(this.lastPath.host) === this.maps.root(host)) this.path.add(this.lastPath.host, this.lastPath.p, host, p);
      this.lastPath = { host, p };
      this.pathFrames.push({ frame: data.getUint32(at, true), host, p });
    }
    this.dirty = true;
  }
  takeTruth(data: DataView): void {
    const points: number[] = [];
    for (let at = 0; at < data.byteLength; at += 4) points.push(data.getFloat32(at, true));
    this.truth.geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  }
  takeSurface(data: DataView): void {
    this.dense.takeSurface(data);
    this.showLayers();
  }
  takeGrid(data: DataView): void {
    this.dense.takeGrid(data);
    this.showLayers();
  }
  // `root`: of the map that the frame is in; negative where it is in none.
  takeFrame(camera: number[] | undefined, movers: Mover[], worldFromTruth: number[] | undefined, root: number): void {
    this.tracked = camera !== undefined;
    if (camera) {
      this.cameraPose = matrixOf(camera);
      this.frustum.matrix.copy(this.cameraPose);
    }
    // Without it, it is not yet laid on the map that the camera is in now.
    this.aligned = worldFromTruth !== undefined;
    if (worldFromTruth) this.truth.matrix.copy(matrixOf(worldFromTruth));
    this.movers.take(movers, this.cameraPose);
    this.maps.takeCamera(root);
    this.showMap();
    this.showLayers();
  }

  // --- what the visitor asks for
  private hidden = new Set<Layer>();
  show(layer: Layer, on: boolean): void {
    if (on) this.hidden.delete(layer);
    else this.hidden.add(layer);
    this.showLayers();
  }
  // What is wanted and there; of what lies in one map's world, what is in the map that is shown.
  private showLayers(): void {
    const on = (layer: Layer) => !this.hidden.has(layer), here = this.maps.showsCamera;
    const isShown = (root: number) => this.maps.shows(root);
    this.cloud.group.visible = on("points");
    this.keyframes.object.visible = on("keyframes");
    this.covisibility.object.visible = on("covisibility");
    this.path.object.visible = on("path");
    this.loops.object.visible = on("loops");
    this.movers.group.visible = on("movers") && here;
    this.truth.visible = on("truth") && this.aligned && here;
    this.frustum.visible = this.tracked && here;
    this.dense.surface.visible = on("surface") && this.dense.shows("surface", isShown);
    this.dense.grid.visible = on("grid") && this.dense.shows("grid", isShown);
    this.dirty = true;
  }
  setMode(mode: Mode): void {
    if (mode === "top") {
      const { at, radius } = this.cloud.middle() ?? { at: new THREE.Vector3(0, 0, 1), radius: 1 };
      const p = new THREE.Vector3();
      const far = this.pathFrames.reduce((r, f) => (this.poses.shows(f.host) ? Math.max(r, this.poses.toWorld(f.host, f.p, p).distanceTo(at)) : r), radius);
      const away = 2 * Math.max(0.5, far);
      this.controls.target.copy(at);
      this.camera.position.set(at.x, at.y - away, at.z - 0.01 * away);
      this.controls.update();
    }
    if (mode === "follow") {
      this.maps.leave();
      this.showMap();
    }
    if (mode === this.mode) return;
    this.mode = mode;
    this.dirty = true;
    this.onMode();
  }
  // The run has ended: there is nobody to follow any more, so the whole map comes into view.
  end(): void {
    this.over = true;
    this.whole ??= this.cloud.middle();
  }
  // Shows where the camera was at a frame, in the map that it was in.
  jumpTo(frame: number): void {
    let best: (typeof this.pathFrames)[number] | null = null;
    for (const p of this.pathFrames) if (!best || Math.abs(p.frame - frame) < Math.abs(best.frame - frame)) best = p;
    if (!best) return;
    this.maps.visit(best.host);
    this.showMap();
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
  private palette: Palette = { keyframe: "", covisibility: "", path: "", loop: "", truth: "", camera: "" };
  paint(): void {
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    this.palette = {
      keyframe: colour("--keyframe"), covisibility: colour("--covisibility"), path: colour("--path"), loop: colour("--loop"),
      truth: colour("--truth"), camera: colour("--camera"),
    };
    this.scene.background = new THREE.Color(colour("--view"));
    this.keyframes.colour = this.palette.keyframe;
    this.covisibility.colour = this.palette.covisibility;
    this.path.colour = this.palette.path;
    this.loops.colour = this.palette.loop;
    this.truth.material.color.set(this.palette.truth);
    this.frustum.material.color.set(this.palette.camera);
    this.movers.paint(colour("--mover"));
    this.markMaterial.color.set(this.palette.loop);
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
      for (const id of this.maps.living()) {
        for (let i = 0; i < 4; i++) {
          this.keyframes.add(id, [0, 0, 0], id, corners[i]);
          this.keyframes.add(id, corners[i], id, corners[(i + 1) % 4]);
        }
      }
    }
    if (this.staleEdges) {
      this.covisibility.clear();
      for (const [id, others] of this.edges) {
        if (!this.maps.lives(id)) continue;
        for (const other of others)
          if (this.maps.lives(other)) this.covisibility.add(id, [0, 0, 0], other, [0, 0, 0]);
      }
    }
    this.staleKeyframes = this.staleEdges = false;
  }
  // What it has drawn: damping goes on below what it draws for.
  private copyLeader(): void {
    const { position, quaternion, target } = this.leader!.drawn;
    if (this.leader!.lastDrawn === 0) return;
    if (this.camera.position.equals(position) && this.controls.target.equals(target)) return;
    this.camera.position.copy(position);
    this.camera.quaternion.copy(quaternion);
    this.controls.target.copy(target);
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
    this.dense.lookFrom(this.camera.position);
    this.renderer.render(this.scene, this.camera);
    this.drawn.position.copy(this.camera.position);
    this.drawn.quaternion.copy(this.camera.quaternion);
    this.drawn.target.copy(this.controls.target);
    this.movers.label(this.canvas.parentElement!.getBoundingClientRect(), this.camera);
    const data = this.canvas.dataset;
    data.points = String(this.cloud.points);
    data.cloudCalls = String(this.cloud.drawCalls);
    data.calls = String(this.renderer.info.render.calls);
    data.geometries = String(this.renderer.info.memory.geometries);
    data.look = this.camera.position.toArray().map((x) => x.toFixed(3)).join(" ");
    data.surface = String(this.dense.surface.visible);
    data.shown = String(this.shownRoot);
    data.frustum = String(this.frustum.visible);
    data.truth = String(this.truth.visible);
    data.drawn = String(Number(data.drawn ?? 0) + 1);
  }
}
