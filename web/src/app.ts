// SPDX-License-Identifier: Apache-2.0
// The page: of a running session, or of one or two recorded ones.
import "./app.css";
import { Panel, type Wish } from "./panel";
import { Player, sessionList } from "./player";
import { headers, order, readStream, token } from "./stream";
import { Transport } from "./transport";
import { layers, View } from "./view";

const at = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const panels: Panel[] = [];
let transport: Transport | null = null;
let depthChanged = () => {};

// What is asked of one panel is asked of all.
function wish(w: Wish): void {
  for (const p of panels) p.obey(w);
  if (w.what === "overlay" && w.name === "depth") depthChanged();
}
function lead(view: View): void {
  for (const p of panels) p.view.leader = p.view === view ? null : view;
}
function addPanel(head: HTMLElement, name: string, openEvent: ConstructorParameters<typeof Panel>[4]): Panel {
  const panel = new Panel(document.querySelector("main")!, head, panels.length, name, openEvent);
  panels.push(panel);
  panel.onWish = wish;
  panel.view.onLead = () => lead(panel.view);
  return panel;
}

// --- dark and light
function paint(theme: string): void {
  document.documentElement.dataset.theme = theme;
  at("theme").textContent = theme === "dark" ? "Light" : "Dark";
  for (const p of panels) p.paint();
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
at("theme").onclick = toggleTheme;

// --- keys
const pause = () => (transport ? transport.toggle() : void order(panels[0]?.state?.paused ? "resume" : "pause"));
const step = () => (transport ? transport.step() : void order("step"));
const measure = () => wish({ what: "measure", on: !panels[0].measures });
at("pause").onclick = pause;
at("step").onclick = step;
at("save").onclick = () => void order("save_map");
const keys = at<HTMLDialogElement>("keys");
at("help").onclick = () => keys.showModal();

document.addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.altKey || e.metaKey || keys.open || panels.length === 0) return;
  const on = e.target as HTMLElement;
  const presses = on.tagName === "BUTTON" || on.tagName === "INPUT" || on.tagName === "SELECT";
  const slides = on.id === "slider" || on.tagName === "SELECT"; // keys of its own
  const number = Number(e.key);
  const view = panels.find((p) => p.at("view") === on)?.view ?? panels[0].view;
  const inView = on.tagName === "CANVAS" || on === document.body;
  const turns: Record<string, [number, number]> = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  if (e.key === " " && (!presses || on.id === "slider")) pause();
  else if (e.key === "n") step();
  else if (e.key === "b" && transport) transport.back();
  else if (e.key === "[" && transport) transport.faster(-1);
  else if (e.key === "]" && transport) transport.faster(1);
  else if (e.key === "Home" && transport && !slides) transport.seek(0);
  else if (e.key === "End" && transport && !slides) transport.seek(Infinity);
  else if (e.key === "f") wish({ what: "mode", mode: "follow" });
  else if (e.key === "g") wish({ what: "mode", mode: "free" });
  else if (e.key === "t") wish({ what: "mode", mode: "top" });
  else if (e.key === "m") measure();
  else if (e.key === "p") wish({ what: "shoot" });
  else if (e.key === "l") toggleTheme();
  else if (e.key === "d") panels[0].click("overlay-depth");
  else if (e.key === "?") keys.showModal();
  else if ((e.key === "+" || e.key === "=") && !slides) view.nearer(0.85);
  else if (e.key === "-" && !slides) view.nearer(1 / 0.85);
  else if (e.key === "Enter" && panels[0].measures && !presses) view.measureAt(0, 0);
  else if (turns[e.key] && inView) view.turn(...turns[e.key]);
  else if (number >= 1 && number <= layers.length) panels[0].click("layer-" + layers[number - 1]);
  else return;
  e.preventDefault();
});

// --- a running session
function showLive(): void {
  const panel = addPanel(at("title"), "", null);
  panel.onState = () => {
    const s = panel.state!;
    at("pause").textContent = s.paused ? "Resume" : "Pause";
    for (const id of ["pause", "step"]) at<HTMLButtonElement>(id).disabled = s.ended;
  };
  let connection: AbortController | null = null;
  let attempt = 0;
  async function connect(): Promise<void> {
    const mine = (connection = new AbortController());
    let status = 0;
    try {
      status = await readStream(`api/stream?images=1${panel.picture.depth ? "&depth=1" : ""}`, mine.signal, (m) => {
        attempt = 0;
        panel.take(m);
      });
    } catch {
      // The server is gone, or this page has let go of it.
    }
    if (mine.signal.aborted || mine !== connection) return;
    if (status === 401) panel.badge("gone", token ? "the token is wrong" : "open the address that was printed, with its token");
    else panel.badge("gone", "no connection");
    // Less and less often: each attempt at a server that has ended is an error in the console.
    if (status !== 401 && attempt < 20) setTimeout(() => mine === connection && connect(), Math.min(10000, 1000 * 1.5 ** attempt++));
  }
  function reconnect(): void {
    connection?.abort();
    void connect();
  }
  depthChanged = reconnect;
  // A page that nobody sees keeps nothing busy.
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) connection?.abort();
    else reconnect();
  });
  if (!document.hidden) void connect();
}

// --- recorded ones
async function showReplay(): Promise<void> {
  const list = await sessionList();
  const compare = list.length > 1;
  document.body.classList.toggle("compare", compare);
  if (compare) at("title").textContent = "two runs, the same time and the same view";
  const players = list.map((info, n) => {
    const panel = addPanel(compare ? document.querySelector("main")! : at("title"), info.name, (e) => transport!.seek(e.time));
    return new Player(n, info, panel);
  });
  lead(panels[0].view);
  transport = new Transport(players);
}

async function begin(): Promise<void> {
  let replay = false;
  try {
    replay = (await (await fetch("api/state", { headers })).json()).replay === true;
  } catch {
    // The stream says what is wrong.
  }
  document.body.classList.add(replay ? "replaying" : "running");
  if (replay) await showReplay();
  else showLive();
  paint(storedTheme() ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark"));
}
void begin();
