// SPDX-License-Identifier: Apache-2.0
// The current image with what became of its features, the movers' mask and boxes.
import type { Mover } from "./movers";

// What became of a feature, by the stage that said so: the pose used it; it disagrees with the point that it was matched
// with; it lies on a mover; it moved otherwise than the camera's motion explains; nothing was matched with it.
export const features = ["used", "disagrees", "on-mover", "moved", "unused"] as const;
export type Feature = (typeof features)[number];
export const featureWords: Record<Feature, string> = { used: "used", disagrees: "disagrees", "on-mover": "on a mover", moved: "moved", unused: "unused" };
const states: Feature[] = ["unused", "used", "disagrees", "on-mover"]; // by the stream's state, where no reason is given
const reasons: (Feature | null)[] = [null, "on-mover", "moved", "disagrees"];

const featureBytes = 6;

export class Picture {
  readonly shown = new Set<string>(["used", "disagrees", "on-mover", "moved", "mask", "boxes"]);
  depth = false;
  counts: Record<string, number> = {};
  private image: ImageBitmap | null = null;
  private depthImage: ImageBitmap | null = null;
  private width = 640;
  private report: DataView | null = null;
  private movers: Mover[] = [];
  private boxes: { class: string; box: number[] }[] = [];
  private waiting = false;
  private unit = 1;
  private asked = 0; // pictures so far
  private newest = [0, 0]; // of those that are there, colour and depth

  constructor(private canvas: HTMLCanvasElement) {}

  // `unit` [px]: that features are told in.
  begin(width: number, height: number, unit: number): void {
    this.width = width;
    this.unit = unit;
    this.canvas.width = 640;
    this.canvas.height = Math.round((640 * height) / width);
    this.image?.close();
    this.depthImage?.close();
    this.image = this.depthImage = null;
    this.newest = [this.asked, this.asked]; // what is on its way is of before
  }
  async takeImage(data: DataView): Promise<void> {
    if (data.byteLength <= 4) return; // of a frame without images
    const depth = data.getUint32(0, true) === 1, number = ++this.asked;
    const bytes = new Uint8Array(data.buffer as ArrayBuffer, data.byteOffset + 4, data.byteLength - 4);
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
    // Pictures are not ready in the order in which they came.
    if (number <= this.newest[depth ? 1 : 0]) return bitmap.close();
    this.newest[depth ? 1 : 0] = number;
    if (depth) {
      this.depthImage?.close();
      this.depthImage = bitmap;
    } else {
      this.image?.close();
      this.image = bitmap;
    }
    this.refresh();
  }
  // `report`: features and mask of the frame's message.
  take(report: DataView, movers: Mover[], boxes: { class: string; box: number[] }[]): void {
    this.report = report;
    this.movers = movers;
    this.boxes = boxes;
    const counts: Record<string, number> = {};
    const n = report.getUint32(0, true);
    for (let i = 0; i < n; i++) {
      const fate = this.fate(i);
      counts[fate] = (counts[fate] ?? 0) + 1;
    }
    this.counts = counts;
    this.refresh();
  }
  private fate(i: number): Feature {
    const at = 4 + featureBytes * i;
    return reasons[this.report!.getUint8(at + 5)] ?? states[this.report!.getUint8(at + 4)] ?? "unused";
  }
  // In words, what became of the feature nearest to a place in the canvas [its pixels]; "" when none is near.
  tell(x: number, y: number): string {
    const report = this.report, s = this.canvas.width / this.width;
    let best = 10, words = "";
    for (let i = 0, n = report ? report.getUint32(0, true) : 0; i < n; i++) {
      const fate = this.fate(i), u = report!.getUint16(4 + featureBytes * i, true) * this.unit, v = report!.getUint16(6 + featureBytes * i, true) * this.unit;
      const distance = Math.hypot(u * s - x, v * s - y);
      if (!this.shown.has(fate) || distance >= best) continue;
      best = distance;
      words = `${featureWords[fate]} (${u.toFixed(1)}, ${v.toFixed(1)})`;
    }
    return words;
  }
  refresh(): void {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }
  private draw(): void {
    const g = this.canvas.getContext("2d")!;
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    g.fillStyle = "#111";
    g.fillRect(0, 0, this.canvas.width, this.canvas.height);
    const image = this.depth ? this.depthImage : this.image;
    if (image) g.drawImage(image, 0, 0, this.canvas.width, this.canvas.height);
    const report = this.report;
    if (!report) return;
    const s = this.canvas.width / this.width;
    const n = report.getUint32(0, true);
    if (this.shown.has("mask")) this.drawMask(g, report, 4 + featureBytes * n, s, colour("--mover"));
    const shapes: Record<Feature, (x: number, y: number) => void> = {
      used: (x, y) => { g.moveTo(x + 4.5, y); g.arc(x, y, 4.5, 0, 7); },
      disagrees: (x, y) => { g.moveTo(x - 4, y - 4); g.lineTo(x + 4, y + 4); g.moveTo(x + 4, y - 4); g.lineTo(x - 4, y + 4); },
      "on-mover": (x, y) => g.rect(x - 4, y - 4, 8, 8),
      moved: (x, y) => { g.moveTo(x, y - 5); g.lineTo(x + 5, y); g.lineTo(x, y + 5); g.lineTo(x - 5, y); g.closePath(); },
      unused: (x, y) => g.rect(x - 1, y - 1, 2, 2),
    };
    g.lineWidth = 2;
    for (const kind of features) {
      if (!this.shown.has(kind)) continue;
      g.beginPath();
      for (let i = 0; i < n; i++) {
        const at = 4 + featureBytes * i;
        if (this.fate(i) !== kind) continue;
        shapes[kind](report.getUint16(at, true) * this.unit * s, report.getUint16(at + 2, true) * this.unit * s);
      }
      g.strokeStyle = colour("--" + kind);
      g.stroke();
    }
    if (!this.shown.has("boxes")) return;
    g.font = "bold 15px system-ui, sans-serif";
    const frame = (box: number[], text: string, dash: number[], stroke: string) => {
      g.setLineDash(dash);
      g.strokeStyle = stroke;
      g.lineWidth = 2;
      g.strokeRect(box[0] * s, box[1] * s, box[2] * s, box[3] * s);
      g.setLineDash([]);
      const y = Math.max(16, box[1] * s - 5), w = g.measureText(text).width;
      g.fillStyle = "rgba(0, 0, 0, 0.65)";
      g.fillRect(box[0] * s, y - 14, w + 6, 18);
      g.fillStyle = "#fff";
      g.fillText(text, box[0] * s + 3, y);
    };
    for (const b of this.boxes) frame(b.box, b.class, [6, 4], colour("--on-mover"));
    for (const m of this.movers) frame(m.box, `${m.class} ${m.id}`, [], colour("--mover"));
  }
  private drawMask(g: CanvasRenderingContext2D, report: DataView, at: number, s: number, colour: string): void {
    const cell = report.getUint32(at, true) * s, w = report.getUint32(at + 4, true), h = report.getUint32(at + 8, true);
    g.fillStyle = colour;
    g.globalAlpha = 0.35;
    for (let y = 0; y < h; y++)
      for (let x = 0; x < w; ) {
        const set = (i: number) => (report.getUint8(at + 12 + (i >> 3)) >> (i & 7)) & 1;
        let end = x;
        while (end < w && set(y * w + end)) end++;
        if (end > x) g.fillRect(x * cell, y * cell, (end - x) * cell, cell);
        x = end + 1;
      }
    g.globalAlpha = 1;
  }
}
