// SPDX-License-Identifier: Apache-2.0
// Tracking time against the frame's budget, and tracked points, over the last minute.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

const kept = 18000; // frames, as the server keeps

export class Charts {
  private time: number[] = [];
  private ms: number[] = [];
  private points: number[] = [];
  private keyframe: (number | null)[] = [];
  private lost: (number | null)[] = [];
  private plots: uPlot[] = [];
  private drawn = 0;
  private stale = false;
  budget = 33.3;
  whole = false;

  constructor(private timeBox: HTMLElement, private pointsBox: HTMLElement) {
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
    this.time = [];
    this.ms = [];
    this.points = [];
    this.keyframe = [];
    this.lost = [];
    this.stale = true;
  }
  take(data: DataView): void {
    for (let at = 0; at < data.byteLength; at += 20) {
      const inliers = data.getUint16(at + 16, true), state = data.getUint8(at + 18);
      this.time.push(data.getFloat32(at + 12, true));
      this.ms.push(data.getFloat32(at + 4, true));
      this.points.push(inliers);
      this.keyframe.push(data.getUint8(at + 19) ? inliers : null);
      this.lost.push(state === 2 ? 0 : null);
    }
    if (this.time.length > 2 * kept)
      for (const list of [this.time, this.ms, this.points, this.keyframe, this.lost] as unknown[][]) list.splice(0, list.length - kept);
    this.stale = true;
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
        series: [{}, ...series], padding: [6, 6, 0, 0],
      }, [[]], box);
    this.plots = [
      make(this.timeBox, " ms", [
        { stroke: colour("--used"), width: 1, points: { show: false } },
        { stroke: colour("--dynamic"), width: 1.5, dash: [6, 4], points: { show: false } },
      ], (_min, max) => [0, Math.max(1.2 * this.budget, Math.min(max * 1.1, 6 * this.budget))]),
      make(this.pointsBox, "", [
        { stroke: colour("--used"), width: 1, points: { show: false } },
        { stroke: colour("--keyframe"), width: 0, paths: () => null, points: { show: true, size: 6, fill: colour("--keyframe") } },
        { stroke: colour("--dynamic"), width: 0, paths: () => null, points: { show: true, size: 5, fill: colour("--dynamic") } },
      ], (_min, max) => [0, Math.max(10, max * 1.15)]),
    ];
    this.stale = true;
    this.draw();
  }
  private draw(): void {
    if (!this.stale || this.plots.length === 0 || document.hidden) return;
    this.stale = false;
    this.drawn++;
    const last = this.time[this.time.length - 1] ?? 0;
    let from = 0;
    if (!this.whole) while (from < this.time.length && this.time[from] < last - 60) from++;
    const t = this.time.slice(from);
    this.plots[0].setData([t, this.ms.slice(from), t.map(() => this.budget)]);
    this.plots[1].setData([t, this.points.slice(from), this.keyframe.slice(from), this.lost.slice(from)]);
  }
}
