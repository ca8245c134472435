// SPDX-License-Identifier: Apache-2.0
// What a frame's time went into, against its budget, and tracked points with the rules that made keyframes, over the
// last minute.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { SessionEvent } from "./events";

const kept = 18000; // frames, as the server keeps
const shown = 60; // [s]
// Stages that tracking itself consists of, bottom to top; what is left of it is the rest. Others have threads of their own.
// A report (apps/report/report_verdict.cpp) has the same list.
const parts = ["features", "motion", "flow", "filter", "keyframe_decision", "rest"];
const beside = ["mapping", "loop", "global_ba", "detection", "segmentation", "carrying", "wait_mapper", "wait_detector"];
const shapes = ["●", "■", "▲", "◆"];

type StageFact = { frame: number; times: Map<number, number> };

export class Charts {
  private time: number[] = [];
  private frames: number[] = [];
  private ms: number[] = [];
  private points: number[] = [];
  private keyframe: boolean[] = [];
  private lost: (number | null)[] = [];
  private names: string[] = [];
  private stages: StageFact[] = [];
  private rules: string[] = []; // that made keyframes, in the order in which they came
  private ruleOf = new Map<number, string>(); // by frame
  private plots: uPlot[] = [];
  private off = new Set<string>(beside.slice(1));
  private legend = new Map<string, HTMLButtonElement>();
  private stale = false;
  budget = 33.3;

  constructor(private timeBox: HTMLElement, private pointsBox: HTMLElement, private stageBox: HTMLElement, private ruleBox: HTMLElement) {
    setInterval(() => this.draw(), 200);
    const observer = new ResizeObserver(() => {
      for (const [i, box] of [timeBox, pointsBox].entries())
        this.plots[i]?.setSize({ width: box.clientWidth, height: box.clientHeight });
    });
    observer.observe(timeBox);
    observer.observe(pointsBox);
  }
  begin(budget: number): void {
    this.budget = budget;
    for (const list of [this.time, this.frames, this.ms, this.points, this.keyframe, this.lost, this.stages] as unknown[][]) list.length = 0;
    this.stale = true;
  }
  take(data: DataView): void {
    for (let at = 0; at < data.byteLength; at += 16) {
      const inliers = data.getUint16(at + 12, true), state = data.getUint8(at + 14);
      this.frames.push(data.getUint32(at, true));
      this.time.push(data.getFloat32(at + 8, true));
      this.ms.push(data.getFloat32(at + 4, true));
      this.points.push(inliers);
      this.keyframe.push(data.getUint8(at + 15) === 1);
      this.lost.push(state === 2 ? 0 : null);
    }
    if (this.time.length > 2 * kept)
      for (const list of [this.time, this.frames, this.ms, this.points, this.keyframe, this.lost] as unknown[][]) list.splice(0, list.length - kept);
    this.stale = true;
  }
  takeStageNames(names: string[]): void {
    this.names = names;
    for (const stage of [...parts, ...beside]) if (!this.legend.has(stage) && (names.includes(stage) || stage === "rest")) this.offer(stage);
  }
  takeStages(data: DataView): void {
    for (let at = 0; at < data.byteLength; ) {
      const n = data.getUint32(at + 4, true), times = new Map<number, number>();
      for (let i = 0; i < n; i++) times.set(data.getUint16(at + 8 + 4 * i, true), data.getUint16(at + 10 + 4 * i, true) / 50);
      this.stages.push({ frame: data.getUint32(at, true), times });
      at += 8 + 4 * n;
    }
    if (this.stages.length > 4000) this.stages.splice(0, this.stages.length - 2000);
    this.stale = true;
  }
  takeEvents(events: SessionEvent[]): void {
    for (const e of events) {
      if (e.kind !== "keyframe") continue;
      const rule = e.text || "keyframe";
      this.ruleOf.set(e.frame, rule);
      this.stale = true; // its frame may have come before
      if (this.rules.includes(rule)) continue;
      this.rules.push(rule);
      this.paint();
    }
    // The oldest are further back than the chart.
    for (const frame of this.ruleOf.keys()) {
      if (this.ruleOf.size < 4 * kept) break;
      this.ruleOf.delete(frame);
    }
  }
  private offer(stage: string): void {
    const button = document.createElement("button");
    button.textContent = `${parts.includes(stage) ? "■" : "●"} ${stage.replace("keyframe_", "").replace("_", " ")}`;
    button.style.color = parts.includes(stage) ? `var(--${stage})` : "var(--text)";
    button.title = parts.includes(stage) ? "part of tracking; click to hide or show" : "beside tracking, on another thread; click to hide or show";
    button.setAttribute("aria-pressed", String(!this.off.has(stage)));
    button.onclick = () => {
      if (!this.off.delete(stage)) this.off.add(stage);
      button.setAttribute("aria-pressed", String(!this.off.has(stage)));
      this.stale = true;
    };
    this.legend.set(stage, button);
    this.stageBox.replaceChildren(...[...parts, ...beside].flatMap((s) => this.legend.get(s) ?? []));
  }
  // Also after a change of colours.
  paint(): void {
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    for (const p of this.plots) p.destroy();
    const axes = (unit: string): uPlot.Axis[] => [
      { stroke: colour("--text"), grid: { stroke: colour("--line"), width: 1 }, ticks: { show: false }, font: "11px system-ui", size: 22, values: (_u, v) => v.map((x) => x + " s") },
      { stroke: colour("--text"), grid: { stroke: colour("--line"), width: 1 }, ticks: { show: false }, font: "11px system-ui", size: 46, values: (_u, v) => v.map((x) => x + unit) },
    ];
    const make = (box: HTMLElement, unit: string, series: uPlot.Series[], range: (min: number, max: number) => [number, number]) =>
      new uPlot({
        width: box.clientWidth || 300, height: box.clientHeight || 90, legend: { show: false }, cursor: { show: false },
        scales: { x: { time: false }, y: { range: (_u, min, max) => range(min ?? 0, max ?? 1) } }, axes: axes(unit),
        series: [{}, ...series], padding: [6, 20, 0, 0], // half of the last time's label
      }, [[]], box);
    const dots = (c: string, shape: string, size = 6): uPlot.Series => ({
      stroke: c, width: 0, paths: () => null, points: { show: true, size, fill: c, ...markPaths(shape, size) },
    });
    const ruleColours = [colour("--keyframe"), colour("--loop"), colour("--motion"), colour("--flow")];
    // After four rules shapes come again, each with the next colour.
    const ruleColour = (i: number) => ruleColours[(i + Math.floor(i / 4)) % 4];
    this.plots = [
      make(this.timeBox, " ms", [
        // The sums, the largest first: what is drawn later covers what lies below.
        ...[...parts].reverse().map((s): uPlot.Series => ({ stroke: colour("--" + s), fill: colour("--" + s), width: 0, points: { show: false } })),
        { stroke: colour("--on-mover"), width: 1.5, dash: [6, 4], points: { show: false } },
        ...beside.map(() => dots(colour("--text"), "●", 3)),
      ], (_min, max) => [0, Math.max(1.2 * this.budget, Math.min(max * 1.1, 6 * this.budget))]),
      make(this.pointsBox, "", [
        { stroke: colour("--used"), width: 1, points: { show: false } },
        ...this.rules.map((_rule, i) => dots(ruleColour(i), shapes[i % 4])),
        dots(colour("--text"), "●", 4), // rules that are not known yet
        dots(colour("--on-mover"), "×"),
      ], (_min, max) => [0, Math.max(10, max * 1.15)]),
    ];
    this.ruleBox.replaceChildren(...this.rules.map((rule, i) => {
      const item = document.createElement("span");
      item.textContent = `${shapes[i % 4]} ${rule}`;
      item.style.color = ruleColour(i);
      return item;
    }));
    this.ruleBox.title = "keyframes, by the rule that made them; a small dot: the rule is not known yet";
    this.stageBox.title = `dashed: ${this.budget.toFixed(0)} ms, the frame's budget`;
    this.stale = true;
    this.draw();
  }
  private draw(): void {
    if (!this.stale || this.plots.length === 0 || document.hidden) return;
    this.stale = false;
    const last = this.time[this.time.length - 1] ?? 0;
    let from = this.time.length;
    while (from > 0 && this.time[from - 1] >= last - shown) from--;
    const t = this.time.slice(from), frames = this.frames.slice(from), ms = this.ms.slice(from), points = this.points.slice(from);
    const byFrame = new Map(this.stages.map((s) => [s.frame, s.times]));
    const timeOf = (frame: number, stage: string) => byFrame.get(frame)?.get(this.names.indexOf(stage));
    // Sums from below; a part that is hidden is left out.
    const sums = t.map(() => 0), stack: number[][] = [];
    for (const part of parts) {
      for (let i = 0; i < t.length; i++) {
        const known = parts.slice(0, -1).reduce((sum, p) => sum + (timeOf(frames[i], p) ?? 0), 0);
        if (!this.off.has(part)) sums[i] += part === "rest" ? Math.max(0, ms[i] - known) : timeOf(frames[i], part) ?? 0;
      }
      stack.unshift([...sums]);
    }
    const others = beside.map((s) => (this.off.has(s) ? t.map(() => null) : frames.map((f) => timeOf(f, s) ?? null)));
    this.plots[0].setData([t, ...stack, t.map(() => this.budget), ...others]);
    const marks = this.rules.map((rule) => points.map((p, i) => (this.keyframe[from + i] && this.ruleOf.get(frames[i]) === rule ? p : null)));
    marks.push(points.map((p, i) => (this.keyframe[from + i] && !this.ruleOf.has(frames[i]) ? p : null)));
    this.plots[1].setData([t, points, ...marks, this.lost.slice(from)]);
  }
}

// Marks that differ in shape, not only in colour.
function markPaths(shape: string, size: number): { paths?: uPlot.Series.Points.PathBuilder } {
  if (shape === "●") return {};
  const paths: uPlot.Series.Points.PathBuilder = (u, series, first, last) => {
    const path = new Path2D(), r = (size / 2) * devicePixelRatio * 1.1;
    for (let i = first; i <= last; i++) {
      const value = u.data[series][i];
      if (value == null) continue;
      const x = u.valToPos(u.data[0][i], "x", true), y = u.valToPos(value, "y", true);
      const corners: [number, number][] = shape === "■" ? [[-r, -r], [r, -r], [r, r], [-r, r]] : shape === "▲" ? [[-r, r], [0, -r], [r, r]] : shape === "◆" ? [[0, -r], [r, 0], [0, r], [-r, 0]]
        : [[-r, -r], [0, -r / 2], [r, -r], [r / 2, 0], [r, r], [0, r / 2], [-r, r], [-r / 2, 0]];
      corners.forEach(([dx, dy], k) => (k === 0 ? path.moveTo(x + dx, y + dy) : path.lineTo(x + dx, y + dy)));
      path.closePath();
    }
    return { stroke: new Path2D(), fill: path };
  };
  return { paths };
}
