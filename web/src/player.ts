// SPDX-License-Identifier: Apache-2.0
// Plays a recorded session into a panel: fetches its file piece by piece, ahead of the time that is shown.
import type { Panel } from "./panel";
import { headers, Kind, type Message } from "./stream";

export type Recording = {
  name: string; seconds: number; size: number; ended: boolean; damaged: boolean;
  entries: [number, number, number][]; // time, frame and byte of the places where one may begin
};
export async function sessionList(): Promise<Recording[]> {
  const answer = await fetch("api/sessions", { headers });
  return answer.ok ? answer.json() : [];
}

const headBytes = 32, checkpoint = 1; // as src/dkb/viewer/session_file.h
const piece = 1 << 20, ahead = 2 << 20; // [bytes]
const firstWait = 250, longestWait = 5000; // [ms] after fetches that failed

type Head = { flags: number; time: number; frame: number; bytes: number };

export class Player {
  time = -1; // of the newest chunk that the panel was told
  frame = -1;
  private buffer = new Uint8Array(0);
  private at = 0; // where in the file the buffer begins
  private used = 0; // of the buffer
  private anew = true; // the next chunk is where we begin, be it a checkpoint or not
  private fetching = false;
  private generation = 0;
  private failures = 0; // of fetches, one after another
  private retryAt = 0; // [ms] performance.now()

  constructor(private n: number, public info: Recording, readonly panel: Panel) {}

  // All there is has been told, and there will be no more.
  get over(): boolean {
    return this.at + this.used >= this.info.size && (this.info.ended || this.info.damaged);
  }

  // Tells the panel what was up to `time` (`before`: not at `time` itself), in about `patience` ms. Returns whether that
  // was all; else call again. Of frames and pictures only the last is told.
  advance(time: number, patience: number, before = false): boolean {
    const until = performance.now() + patience;
    const last = new Map<string, Message>();
    let all = false;
    while (!all && performance.now() < until) {
      const head = this.next();
      if (!head) {
        all = this.at + this.used >= this.info.size;
        break;
      }
      if (before ? head.time >= time : head.time > time) {
        all = true;
        break;
      }
      const end = this.used + headBytes + head.bytes;
      if (end > this.buffer.length) break;
      this.messages(this.used + headBytes, end, last);
      this.anew = false;
      this.used = end;
      this.time = head.time;
      this.frame = head.frame;
    }
    this.fill();
    for (const message of last.values()) this.panel.take(message);
    return all;
  }
  // When the next frame is; null as long as that is not known, Infinity when there is none.
  nextTime(): number | null {
    const head = this.next();
    this.fill();
    return head ? head.time : this.at + this.used >= this.info.size ? Infinity : null;
  }
  // Goes to the last place to begin at before `time`, unless the way there is shorter from here. advance() does the rest.
  seek(time: number, before: boolean): void {
    const entries = this.info.entries;
    let i = entries.length - 1;
    while (i > 0 && (before ? entries[i][0] >= time : entries[i][0] > time)) i--;
    const here = this.at + this.used;
    const goesOn = !this.anew && (before ? this.time < time : this.time <= time);
    if (!goesOn || entries[i][2] > here) this.begin(entries[i][2]);
  }

  private begin(at: number): void {
    this.jump(at);
    this.anew = true;
    this.time = -1;
  }
  private jump(at: number): void {
    this.buffer = new Uint8Array(0);
    this.at = at;
    this.used = 0;
    this.generation++;
  }
  // The next chunk's head, past checkpoints; null when it is not there yet.
  private next(): Head | null {
    while (this.buffer.length - this.used >= headBytes) {
      const view = new DataView(this.buffer.buffer, this.buffer.byteOffset + this.used, headBytes);
      const head = { flags: view.getUint32(12, true), time: view.getFloat64(16, true), frame: view.getInt32(24, true), bytes: view.getUint32(28, true) };
      if ((head.flags & checkpoint) === 0 || this.anew) return head;
      const end = this.used + headBytes + head.bytes;
      if (end <= this.buffer.length) this.used = end;
      else this.jump(this.at + end);
    }
    return null;
  }
  private fill(): void {
    const head = this.next(); // first: it may jump past a checkpoint, and what is fetched is joined where the buffer ends
    const end = this.at + this.buffer.length;
    const left = this.buffer.length - this.used;
    const wanted = head ? Math.max(ahead, headBytes + head.bytes) : ahead;
    if (this.fetching || document.hidden || left >= wanted || end >= this.info.size || performance.now() < this.retryAt) return;
    this.fetching = true;
    const generation = this.generation;
    void fetch(`api/session?n=${this.n}&from=${end}&to=${Math.min(this.info.size, end + Math.max(piece, Math.min(wanted - left, 4 * piece)))}`, { headers })
      .then((answer) => {
        if (!answer.ok) throw new Error(`${answer.status}`);
        return answer.arrayBuffer();
      })
      .then((bytes) => {
        if (bytes.byteLength === 0) throw new Error("the file has become shorter");
        this.failures = 0;
        if (generation !== this.generation) return;
        const joined = new Uint8Array(this.buffer.length - this.used + bytes.byteLength);
        joined.set(this.buffer.subarray(this.used));
        joined.set(new Uint8Array(bytes), this.buffer.length - this.used);
        this.buffer = joined;
        this.at += this.used;
        this.used = 0;
      })
      .catch(() => {
        this.panel.badge("gone", "no connection");
        this.retryAt = performance.now() + Math.min(firstWait * 2 ** this.failures++, longestWait);
      })
      .finally(() => (this.fetching = false));
  }
  private messages(from: number, to: number, last: Map<string, Message>): void {
    const view = new DataView(this.buffer.buffer, this.buffer.byteOffset);
    try {
      for (let at = from; at + 8 <= to; ) {
        const length = view.getUint32(at, true), kind = view.getUint8(at + 4) as Kind;
        if (at + 8 + length > to) throw new RangeError();
        // A copy of what is kept longer than this call.
        const kept = kind === Kind.frame || kind === Kind.image;
        const data = kept ? new DataView(this.buffer.slice(at + 8, at + 8 + length).buffer) : new DataView(this.buffer.buffer, this.buffer.byteOffset + at + 8, length);
        if (kept) last.set(kind === Kind.image ? `image ${data.getUint32(0, true)}` : "frame", { kind, data });
        else this.panel.take({ kind, data });
        at += 8 + length;
      }
    } catch {
      this.panel.badge("gone", "the recording is damaged here");
    }
  }
}
