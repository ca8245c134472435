// SPDX-License-Identifier: Apache-2.0
// One session on the page: what its messages tell goes to the 3-D view, the picture, the charts and the lists.
import { Charts } from "./charts";
import { EventList, type SessionEvent } from "./events";
import { features, featureWords, Picture } from "./picture";
import { Kind, protocol, type Message } from "./stream";
import { layers, View, type Hello, type Layer, type Mode } from "./view";

export type State = {
  frame: number; frames: number; tracked: number; lost: number; state: string; inliers: number; keyframes: number;
  map_points: number; loops: number; movers: number; tracking_ms: number; paused: boolean; ended: boolean;
};

const layerColours: Record<Layer, string> = {
  points: "var(--text)", keyframes: "var(--keyframe)", covisibility: "var(--covisibility)", path: "var(--path)",
  movers: "var(--mover)", truth: "var(--truth)", loops: "var(--loop)", surface: "var(--text)", grid: "var(--flow)",
};
const marks: Record<string, string> = { used: "○", disagrees: "×", "on-mover": "□", moved: "◇", unused: "·" };
const modes: Mode[] = ["follow", "free", "top"];

const text = new TextDecoder();
const json = (data: DataView, from = 0, length = data.byteLength - from) => JSON.parse(text.decode(new Uint8Array(data.buffer, data.byteOffset + from, length)));

// What a visitor asks of one panel holds for all of them.
export type Wish =
  | { what: "layer"; name: Layer; on: boolean } | { what: "overlay"; name: string; on: boolean }
  | { what: "offer"; layer: Layer } | { what: "mode"; mode: Mode } | { what: "measure"; on: boolean } | { what: "shoot" };

export class Panel {
  readonly view: View;
  readonly picture: Picture;
  readonly charts: Charts;
  state: State | null = null;
  onWish: (wish: Wish) => void = (wish) => this.obey(wish);
  onState: () => void = () => {};
  private events: EventList;
  private boxes = new Map<string, HTMLInputElement>();
  private cells = new Map<string, HTMLElement>();
  private measuring = false;
  private foreign = false; // what is told is of another version
  private replays: boolean;
  private roots: HTMLElement[];

  // `name`: of a recorded session, else empty. `openEvent`: nothing = an event leads to where the camera was.
  constructor(main: HTMLElement, head: HTMLElement, private number: number, name: string, openEvent: ((e: SessionEvent) => void) | null) {
    this.replays = name !== "";
    const copy = (id: string) => (document.getElementById(id + "-template") as HTMLTemplateElement).content.firstElementChild!.cloneNode(true) as HTMLElement;
    const root = copy("panel"), headRoot = copy("head");
    this.roots = [root, headRoot];
    main.append(root);
    (head === main ? root : head).prepend(headRoot);
    // The first panel's parts have names of their own, for links and tests.
    if (number === 0) for (const r of this.roots) for (const e of r.querySelectorAll<HTMLElement>("[class]"))
      if (!document.getElementById(e.classList[0])) e.id = e.classList[0];
    this.at("name").textContent = name;
    this.at("name").hidden = name === "";
    this.view = new View(this.at<HTMLCanvasElement>("view"), this.at("labels"));
    this.picture = new Picture(this.at<HTMLCanvasElement>("picture"));
    this.charts = new Charts(this.at("time"), this.at("points"), this.at("stages"), this.at("rules"));
    this.events = new EventList(this.at("events"), openEvent !== null, openEvent ? "goes to its time" : "shows where the camera was",
      openEvent ?? ((e) => this.view.jumpTo(e.frame)));
    layers.forEach((layer, i) => this.checkbox("layers", "layer", layer, `${i + 1} ${layer}`, layerColours[layer], true));
    for (const layer of ["surface", "grid"] as Layer[]) this.offer(layer, false);
    for (const kind of [...features, "mask", "boxes"])
      this.checkbox("overlays", "overlay", kind, kind, `var(--${kind === "mask" || kind === "boxes" ? "mover" : kind})`, this.picture.shown.has(kind));
    this.checkbox("overlays", "overlay", "depth", "depth", "var(--text)", false);
    for (const m of modes) this.at(m).onclick = () => this.onWish({ what: "mode", mode: m });
    this.view.onMode = () => this.onWish({ what: "mode", mode: this.view.mode });
    this.showMode();
    this.at("measure").onclick = () => this.onWish({ what: "measure", on: !this.measuring });
    this.at("shot").onclick = () => this.onWish({ what: "shoot" });
    this.view.onMaps = (words) => {
      if (this.at("maps").textContent !== words) this.at("maps").textContent = words;
    };
    this.view.onMeasure = (words) => (this.at("measured").textContent = words);
    const image = this.at<HTMLCanvasElement>("picture");
    image.addEventListener("pointermove", (e) => {
      const box = image.getBoundingClientRect();
      image.title = this.picture.tell(((e.clientX - box.left) * image.width) / box.width, ((e.clientY - box.top) * image.height) / box.height);
    });
    let pressed: [number, number] | null = null;
    const canvas = this.at("view");
    canvas.addEventListener("pointerdown", (e) => (pressed = [e.clientX, e.clientY]));
    canvas.addEventListener("pointerup", (e) => {
      if (!this.measuring || !pressed || Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) > 5) return;
      const box = canvas.getBoundingClientRect();
      this.view.measureAt((2 * (e.clientX - box.left)) / box.width - 1, 1 - (2 * (e.clientY - box.top)) / box.height);
    });
  }
  at<T extends HTMLElement>(name: string): T {
    for (const root of this.roots) {
      const found = root.querySelector<T>("." + name);
      if (found) return found;
    }
    throw new Error("no part " + name);
  }
  private checkbox(parent: string, what: "layer" | "overlay", name: string, words: string, colour: string, on: boolean): void {
    const label = document.createElement("label"), box = document.createElement("input"), shown = document.createElement("span");
    box.type = "checkbox";
    box.checked = on;
    if (this.number === 0) box.id = `${what}-${name}`;
    box.onchange = () => this.onWish({ what, name, on: box.checked } as Wish);
    shown.textContent = words;
    shown.style.color = colour;
    label.append(box, shown);
    this.at(parent).append(label);
    this.boxes.set(`${what}-${name}`, box);
  }
  // Layers of which there is nothing are not offered.
  private offer(layer: Layer, on: boolean): void {
    this.boxes.get("layer-" + layer)!.parentElement!.hidden = !on;
  }
  click(box: string): void {
    this.boxes.get(box)!.click();
  }
  get measures(): boolean {
    return this.measuring;
  }

  obey(wish: Wish): void {
    if (wish.what === "layer" || wish.what === "overlay") this.boxes.get(`${wish.what}-${wish.name}`)!.checked = wish.on;
    switch (wish.what) {
      case "layer":
        this.view.show(wish.name, wish.on);
        break;
      case "overlay":
        if (wish.name === "depth") this.picture.depth = wish.on;
        else if (wish.on) this.picture.shown.add(wish.name);
        else this.picture.shown.delete(wish.name);
        this.picture.refresh();
        break;
      case "offer":
        this.offer(wish.layer, true);
        break;
      case "mode":
        this.view.setMode(wish.mode);
        this.showMode();
        break;
      case "measure":
        this.measuring = wish.on;
        this.at("measure").setAttribute("aria-pressed", String(wish.on));
        this.at("crosshair").hidden = this.at("measured").hidden = !wish.on;
        this.at("measured").textContent = "click two points";
        if (!wish.on) this.view.endMeasure();
        break;
      case "shoot":
        this.shoot();
    }
  }
  paint(): void {
    this.view.paint();
    this.charts.paint();
    this.picture.refresh();
  }
  badge(name: string, words: string): void {
    const badge = this.at("badge");
    badge.dataset.state = name;
    if (badge.textContent !== words) badge.textContent = words;
  }
  // Of a recording: the time that is shown.
  showTime(time: number): void {
    this.events.at(time);
  }

  take({ kind, data }: Message): void {
    if (this.foreign && kind !== Kind.hello) return;
    switch (kind) {
      case Kind.hello: {
        const hello = json(data) as Hello;
        this.foreign = hello.protocol !== protocol;
        if (this.foreign) {
          this.badge("gone", this.replays ? "this recording is of another version: it was made by another version of the program, which can replay it"
            : "this page is of another version of the program: load it anew");
          break;
        }
        this.view.begin(hello);
        this.picture.begin(hello.camera.width, hello.camera.height, hello.feature_unit);
        this.charts.begin(hello.budget_ms);
        this.at("source").textContent = hello.source;
        this.events.begin();
        break;
      }
      case Kind.keyframes: this.view.takeKeyframes(data); break;
      case Kind.points: this.view.takePoints(data); break;
      case Kind.covisibility: this.view.takeCovisibility(data); break;
      case Kind.loops: this.view.takeLoops(data); break;
      case Kind.path: this.view.takePath(data); break;
      case Kind.pathReset: this.view.clearPath(); break;
      case Kind.facts: this.charts.take(data); break;
      case Kind.stageNames: this.charts.takeStageNames(json(data)); break;
      case Kind.stages: this.charts.takeStages(data); break;
      case Kind.surface:
        this.view.takeSurface(data);
        this.onWish({ what: "offer", layer: "surface" });
        break;
      case Kind.grid:
        this.view.takeGrid(data);
        this.onWish({ what: "offer", layer: "grid" });
        break;
      case Kind.events: {
        const events = json(data) as SessionEvent[];
        this.events.take(events);
        this.charts.takeEvents(events);
        break;
      }
      case Kind.truth: this.view.takeTruth(data); break;
      case Kind.image: void this.picture.takeImage(data); break;
      case Kind.frame: {
        const length = data.getUint32(0, true);
        const frame = json(data, 4, length);
        this.showState(frame.state);
        this.view.takeFrame(frame.camera, frame.movers, frame.world_from_truth, frame.map);
        this.picture.take(new DataView(data.buffer, data.byteOffset + 4 + length, data.byteLength - 4 - length), frame.movers, frame.boxes);
        for (const kind of features)
          this.boxes.get("overlay-" + kind)!.nextElementSibling!.textContent = `${marks[kind]} ${featureWords[kind]} ${this.picture.counts[kind] ?? 0}`;
        this.at("decision").textContent = frame.explanation;
        break;
      }
    }
  }

  private showMode(): void {
    for (const m of modes) this.at(m).setAttribute("aria-pressed", String(this.view.mode === m));
  }
  private showState(s: State): void {
    this.state = s;
    if (s.ended) this.view.end();
    if (s.ended) this.badge("ended", "ended");
    else if (s.paused) this.badge("paused", "paused");
    else this.badge(s.state, s.state);
    // From 0, as in debug.log, report.html and /api/state.
    this.at("count").textContent = s.frame < 0 ? "no frame yet" : `frame ${s.frame} of ${s.frames}`;
    this.at<HTMLProgressElement>("progress").value = (s.frame + 1) / Math.max(1, s.frames);
    this.tell("tracking", `${s.tracking_ms.toFixed(1)} ms`);
    this.tell("inliers", String(s.inliers));
    this.tell("map points", s.map_points.toLocaleString("en"));
    this.tell("keyframes", String(s.keyframes));
    this.tell("lost", String(s.lost));
    this.tell("loops", String(s.loops));
    this.tell("movers", String(s.movers));
    this.tell("tracked", `${((100 * s.tracked) / Math.max(1, s.tracked + s.lost)).toFixed(0)} %`);
    this.onState();
  }
  private tell(name: string, value: string): void {
    let cell = this.cells.get(name);
    if (!cell) {
      const box = document.createElement("div"), term = document.createElement("dt");
      term.textContent = name;
      cell = document.createElement("dd");
      box.append(term, cell);
      this.at("numbers").append(box);
      this.cells.set(name, cell);
    }
    if (cell.textContent !== value) cell.textContent = value;
  }
  private shoot(): void {
    this.view.picture((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      link.download = `dkb-slam-frame-${this.state?.frame ?? 0}${this.number ? "-" + (this.number + 1) : ""}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }
}
