// SPDX-License-Identifier: Apache-2.0
// The clock of recorded sessions, and what sets it: slider, play and pause, speed, single frames.
import { sessionList, type Player } from "./player";

const at = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const patience = 12; // [ms] of work in one turn

export class Transport {
  private time = 0;
  private playing = true;
  private speed = 1;
  private goal: { time: number; before: boolean } | null = null; // on the way there
  private stepping = false;
  private stride = 1; // [s] in one turn at full speed
  private last = performance.now();
  private slider = at<HTMLInputElement>("slider");
  private choice = at<HTMLSelectElement>("speed");

  constructor(private players: Player[]) {
    at("play").onclick = () => this.toggle();
    at("back").onclick = () => this.back();
    at("forward").onclick = () => this.step();
    this.slider.oninput = () => this.seek(Number(this.slider.value));
    this.choice.onchange = () => (this.speed = Number(this.choice.value));
    const turn = () => {
      requestAnimationFrame(turn);
      this.turn();
    };
    turn();
    setInterval(() => void this.refresh(), 1000);
  }
  get duration(): number {
    return Math.max(...this.players.map((p) => p.info.seconds));
  }
  toggle(): void {
    if (!this.playing && this.time >= this.duration && this.players.every((p) => p.info.ended)) this.seek(0);
    this.playing = !this.playing;
    this.show();
  }
  seek(time: number, before = false): void {
    this.goal = { time: Math.max(0, Math.min(time, this.duration)), before };
    this.stepping = false;
    for (const p of this.players) p.seek(this.goal.time, before);
    this.show();
  }
  step(): void {
    this.playing = false;
    this.stepping = true;
    this.show();
  }
  back(): void {
    this.playing = false;
    const now = Math.max(...this.players.map((p) => p.time));
    if (now > 0) this.seek(now, true);
  }
  faster(by: number): void {
    this.choice.selectedIndex = Math.max(0, Math.min(this.choice.length - 1, this.choice.selectedIndex + by));
    this.speed = Number(this.choice.value);
  }

  private turn(): void {
    const now = performance.now();
    const passed = Math.min(0.25, (now - this.last) / 1000);
    this.last = now;
    if (this.goal) {
      const { time, before } = this.goal;
      if (!this.advance(time, before)) return this.show();
      this.time = before ? Math.max(0, ...this.players.map((p) => p.time)) : time;
      this.goal = null;
    } else if (this.stepping) {
      const times = this.players.map((p) => p.nextTime());
      if (times.includes(null)) return;
      const next = Math.min(...(times as number[]));
      if (next < Infinity && !this.advance(next)) return;
      if (next < Infinity) this.time = next;
      this.stepping = false;
    } else if (this.playing) {
      const full = this.speed === Infinity;
      const next = Math.min(this.duration, this.time + (full ? this.stride : passed * this.speed));
      const all = this.advance(next);
      // At full speed as far as this machine gets in one turn.
      if (full) this.stride = Math.max(0.02, Math.min(600, this.stride * (all && performance.now() - now < patience ? 1.2 : 0.8)));
      this.time = all ? next : Math.max(this.time, Math.min(next, ...this.players.map((p) => (p.over ? next : p.time))));
      if (all && this.time >= this.duration && this.players.every((p) => p.over)) this.playing = false;
    }
    this.show();
  }
  private advance(time: number, before = false): boolean {
    return this.players.map((p) => p.advance(time, patience / this.players.length, before)).every(Boolean);
  }
  // A session that still runs gets longer.
  private async refresh(): Promise<void> {
    if (document.hidden || this.players.every((p) => p.info.ended || p.info.damaged)) return;
    try {
      const list = await sessionList();
      for (const [i, p] of this.players.entries()) if (list[i]) p.info = list[i];
    } catch {
      // The server is gone: what was fetched can still be seen.
    }
  }
  private show(): void {
    const duration = this.duration, time = this.goal?.time ?? this.time;
    this.slider.max = String(duration);
    this.slider.step = String(Math.max(0.001, duration / 5000));
    if (document.activeElement !== this.slider || !this.goal) this.slider.value = String(time);
    const clock = `${stamp(time)} / ${stamp(duration)}`;
    if (at("clock").textContent !== clock) at("clock").textContent = clock;
    this.slider.setAttribute("aria-valuetext", clock);
    at("play").textContent = this.playing ? "Pause" : "Play";
    document.body.dataset.settled = String(!this.goal && !this.stepping);
    for (const p of this.players) p.panel.showTime(this.time);
  }
}

function stamp(seconds: number): string {
  const minutes = Math.floor(seconds / 60), rest = (seconds - 60 * minutes).toFixed(1).padStart(4, "0");
  return minutes >= 60 ? `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${rest}` : `${minutes}:${rest}`;
}
