// SPDX-License-Identifier: Apache-2.0
// The live page: what the stream tells goes to the 3-D view, the picture, the charts and the lists.
import "./app.css";
import { Charts } from "./charts";
import { features, Picture } from "./picture";
import { Kind, order, readStream, token, type Message } from "./stream";
import { layers, View, type Hello, type Layer, type Mode } from "./view";

const at = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const view = new View(at<HTMLCanvasElement>("view"), at("labels"));
const picture = new Picture(at<HTMLCanvasElement>("picture"));
const charts = new Charts(at("time"), at("points"));

type State = {
  frame: number; frames: number; tracked: number; lost: number; state: string; inliers: number; keyframes: number;
  map_points: number; loops: number; movers: number; tracking_ms: number; paused: boolean; ended: boolean;
};
let state: State | null = null;

// --- dark and light
function paint(theme: string): void {
  document.documentElement.dataset.theme = theme;
  at("theme").textContent = theme === "dark" ? "Light" : "Dark";
  view.paint();
  charts.paint();
  picture.refresh();
}
const storedTheme = (): string | null => {
  try {
    return localStorage.getItem("theme");
  } catch {
    return null;
  }
};
function toggleTheme(): void {
  const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  try {
    localStorage.setItem("theme", theme);
  } catch {
    // A browser that keeps nothing begins with its own choice again.
  }
  paint(theme);
}
paint(storedTheme() ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark"));

// --- what is shown
function checkbox(parent: HTMLElement, name: string, text: string, colour: string, on: boolean, change: (on: boolean) => void): HTMLInputElement {
  const label = document.createElement("label"), box = document.createElement("input"), words = document.createElement("span");
  box.type = "checkbox";
  box.checked = on;
  box.id = name;
  box.onchange = () => change(box.checked);
  words.textContent = text;
  words.style.color = colour;
  label.append(box, words);
  parent.append(label);
  return box;
}
const layerBoxes = new Map<Layer, HTMLInputElement>();
const layerColours: Record<Layer, string> = {
  points: "var(--text)", keyframes: "var(--keyframe)", covisibility: "var(--covisibility)", path: "var(--path)",
  movers: "var(--mover)", truth: "var(--truth)", loops: "var(--loop)",
};
layers.forEach((layer, i) =>
  layerBoxes.set(layer, checkbox(at("layers"), "layer-" + layer, `${i + 1} ${layer}`, layerColours[layer], true, (on) => view.show(layer, on))));
const marks: Record<string, string> = { used: "○", outlier: "×", dynamic: "□", unused: "·" };
const featureBoxes = new Map<string, HTMLInputElement>();
for (const kind of [...features, "mask", "boxes"])
  featureBoxes.set(kind, checkbox(at("overlays"), "overlay-" + kind, kind, `var(--${kind === "mask" || kind === "boxes" ? "mover" : kind})`,
    picture.shown.has(kind), (on) => {
      if (on) picture.shown.add(kind);
      else picture.shown.delete(kind);
      picture.refresh();
    }));
const depthBox = checkbox(at("overlays"), "overlay-depth", "depth", "var(--text)", false, (on) => {
  picture.depth = on;
  reconnect();
});

// --- camera, measure, picture
const modes: Mode[] = ["follow", "free", "top"];
view.onMode = () => {
  for (const m of modes) at(m).setAttribute("aria-pressed", String(view.mode === m));
};
view.onMode();
for (const m of modes) at(m).onclick = () => view.setMode(m);
let measuring = false;
function measure(on: boolean): void {
  measuring = on;
  at("measure").setAttribute("aria-pressed", String(on));
  at("crosshair").hidden = at("measured").hidden = !on;
  at("measured").textContent = "click two points";
  if (!on) view.endMeasure();
}
view.onMeasure = (text) => (at("measured").textContent = text);
at("measure").onclick = () => measure(!measuring);
let pressed: [number, number] | null = null;
at("view").addEventListener("pointerdown", (e) => (pressed = [e.clientX, e.clientY]));
at("view").addEventListener("pointerup", (e) => {
  if (!measuring || !pressed || Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) > 5) return;
  const box = at("view").getBoundingClientRect();
  view.measureAt((2 * (e.clientX - box.left)) / box.width - 1, 1 - (2 * (e.clientY - box.top)) / box.height);
});
function shoot(): void {
  view.picture((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `dkb-slam-frame-${state?.frame ?? 0}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}
at("shot").onclick = shoot;

// --- the session
const pause = () => void order(state?.paused ? "resume" : "pause");
const step = () => void order("step");
at("pause").onclick = pause;
at("step").onclick = step;
at("save").onclick = () => void order("save_map");
at("theme").onclick = toggleTheme;
const keys = at<HTMLDialogElement>("keys");
at("help").onclick = () => keys.showModal();

document.addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.altKey || e.metaKey || keys.open) return;
  const on = e.target as HTMLElement;
  const presses = on.tagName === "BUTTON" || on.tagName === "INPUT";
  const number = Number(e.key);
  const inView = on === at("view");
  const turns: Record<string, [number, number]> = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  if (e.key === " " && !presses) pause();
  else if (e.key === "n") step();
  else if (e.key === "f") view.setMode("follow");
  else if (e.key === "g") view.setMode("free");
  else if (e.key === "t") view.setMode("top");
  else if (e.key === "m") measure(!measuring);
  else if (e.key === "p") shoot();
  else if (e.key === "l") toggleTheme();
  else if (e.key === "d") depthBox.click();
  else if (e.key === "?") keys.showModal();
  else if (e.key === "+" || e.key === "=") view.nearer(0.85);
  else if (e.key === "-") view.nearer(1 / 0.85);
  else if (e.key === "Enter" && measuring && !presses) view.measureAt(0, 0);
  else if (turns[e.key] && (inView || on === document.body)) view.turn(...turns[e.key]);
  else if (number >= 1 && number <= layers.length) layerBoxes.get(layers[number - 1])!.click();
  else return;
  e.preventDefault();
});

// --- numbers and events
const cells = new Map<string, HTMLElement>();
function number(name: string, value: string): void {
  let cell = cells.get(name);
  if (!cell) {
    const box = document.createElement("div"), term = document.createElement("dt");
    term.textContent = name;
    cell = document.createElement("dd");
    box.append(term, cell);
    at("numbers").append(box);
    cells.set(name, cell);
  }
  if (cell.textContent !== value) cell.textContent = value;
}
function badge(name: string, text: string): void {
  at("badge").dataset.state = name;
  if (at("badge").textContent !== text) at("badge").textContent = text;
}
function showState(s: State): void {
  state = s;
  if (s.ended) badge("ended", "ended");
  else if (s.paused) badge("paused", "paused");
  else badge(s.state, s.state);
  at("pause").textContent = s.paused ? "Resume" : "Pause";
  for (const id of ["pause", "step"]) at<HTMLButtonElement>(id).disabled = s.ended;
  at("count").textContent = `frame ${s.frame + 1} of ${s.frames}`;
  at<HTMLProgressElement>("progress").value = (s.frame + 1) / Math.max(1, s.frames);
  number("tracking", `${s.tracking_ms.toFixed(1)} ms`);
  number("inliers", String(s.inliers));
  number("map points", s.map_points.toLocaleString("en"));
  number("keyframes", String(s.keyframes));
  number("lost", String(s.lost));
  number("loops", String(s.loops));
  number("movers", String(s.movers));
  number("tracked", `${((100 * s.tracked) / Math.max(1, s.tracked + s.lost)).toFixed(0)} %`);
}
function showEvents(list: { kind: string; frame: number; text: string }[]): void {
  const events = at("events");
  for (const e of list) {
    const row = document.createElement("li"), button = document.createElement("button"), frame = document.createElement("b");
    frame.textContent = String(e.frame + 1);
    button.className = e.kind;
    // Explanations begin with the kind's name.
    const words = e.text.startsWith(e.kind) || e.kind === "note" ? e.text : `${e.kind.replace("_", " ")}${e.text ? ": " + e.text : ""}`;
    button.append(frame, words);
    button.title = words + "\n(shows where the camera was)";
    button.onclick = () => view.jumpTo(e.frame);
    row.append(button);
    events.prepend(row);
  }
  while (events.childElementCount > 300) events.lastElementChild!.remove();
}

// --- the stream
const text = new TextDecoder();
const json = (data: DataView, from = 0, length = data.byteLength - from) => JSON.parse(text.decode(new Uint8Array(data.buffer, from, length)));
function take({ kind, data }: Message): void {
  switch (kind) {
    case Kind.hello: {
      const hello = json(data) as Hello;
      view.begin(hello);
      picture.begin(hello.camera.width, hello.camera.height);
      charts.begin(hello.budget_ms);
      at("source").textContent = hello.source;
      at("budget").textContent = `dashed: ${hello.budget_ms.toFixed(0)} ms, the frame's budget`;
      at("events").replaceChildren();
      break;
    }
    case Kind.keyframes: view.takeKeyframes(data); break;
    case Kind.points: view.takePoints(data); break;
    case Kind.covisibility: view.takeCovisibility(data); break;
    case Kind.loops: view.takeLoops(data); break;
    case Kind.path: view.takePath(data); break;
    case Kind.pathReset: view.clearPath(); break;
    case Kind.facts: charts.take(data); break;
    case Kind.events: showEvents(json(data)); break;
    case Kind.truth: view.takeTruth(data); break;
    case Kind.image: void picture.takeImage(data); break;
    case Kind.frame: {
      const length = data.getUint32(0, true);
      const frame = json(data, 4, length);
      showState(frame.state);
      view.takeFrame(frame.camera, frame.movers, frame.world_from_truth);
      picture.take(new DataView(data.buffer, 4 + length), frame.movers, frame.boxes);
      for (const [name, box] of featureBoxes)
        if (marks[name]) box.nextElementSibling!.textContent = `${marks[name]} ${name} ${picture.counts[name] ?? 0}`;
      at("decision").textContent = frame.explanation;
      break;
    }
  }
}

let connection: AbortController | null = null;
let attempt = 0;
async function connect(): Promise<void> {
  const mine = (connection = new AbortController());
  let status = 0;
  try {
    status = await readStream(`api/stream?images=1${picture.depth ? "&depth=1" : ""}`, mine.signal, (m) => {
      attempt = 0;
      take(m);
    });
  } catch {
    // The server is gone, or this page has let go of it.
  }
  if (mine.signal.aborted || mine !== connection) return;
  if (status === 401) badge("gone", token ? "the token is wrong" : "open the address that was printed, with its token");
  else badge("gone", "no connection");
  // Less and less often: each attempt at a server that has ended is an error in the console.
  if (status !== 401 && attempt < 20) setTimeout(() => mine === connection && connect(), Math.min(10000, 1000 * 1.5 ** attempt++));
}
function reconnect(): void {
  connection?.abort();
  void connect();
}
// A page that nobody sees keeps nothing busy.
document.addEventListener("visibilitychange", () => {
  if (document.hidden) connection?.abort();
  else reconnect();
});
if (!document.hidden) void connect();
