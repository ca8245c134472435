// SPDX-License-Identifier: Apache-2.0
// The list of events, the newest first. A click leads to the event.
export type SessionEvent = { kind: string; frame: number; text: string; time: number };

const most = 300, mostKept = 2000; // rows

export class EventList {
  private known = new Map<string, { event: SessionEvent; row: HTMLElement }>();
  private now = 0;

  // `keep`: of a recording, what is known of its future stays in the list.
  constructor(private list: HTMLElement, private keep: boolean, private hint: string, private open: (e: SessionEvent) => void) {}

  begin(): void {
    if (this.keep) return;
    this.list.replaceChildren();
    this.known.clear();
  }
  take(events: SessionEvent[]): void {
    for (const e of events) {
      const key = `${e.frame} ${e.kind} ${e.text}`;
      if (this.known.has(key)) continue;
      const row = this.row(e);
      row.dataset.key = key;
      // Mostly it is the newest.
      let before = this.list.firstElementChild as HTMLElement | null;
      while (before && Number(before.dataset.frame) > e.frame) before = before.nextElementSibling as HTMLElement | null;
      this.list.insertBefore(row, before);
      this.known.set(key, { event: e, row });
    }
    // The oldest goes; of a recording what is furthest from the time that is shown.
    while (this.known.size > (this.keep ? mostKept : most)) {
      const newest = this.list.firstElementChild as HTMLElement, oldest = this.list.lastElementChild as HTMLElement;
      const gone = this.keep && Number(newest.dataset.time) - this.now > this.now - Number(oldest.dataset.time) ? newest : oldest;
      gone.remove();
      this.known.delete(gone.dataset.key!);
    }
  }
  // Of a recording: what is not yet is shown so.
  at(time: number): void {
    if (!this.keep || time === this.now) return;
    this.now = time;
    for (const { event, row } of this.known.values()) row.classList.toggle("future", event.time > time + 1e-4);
  }
  private row(e: SessionEvent): HTMLElement {
    const row = document.createElement("li"), button = document.createElement("button"), frame = document.createElement("b");
    frame.textContent = String(e.frame);
    button.className = e.kind;
    // Explanations begin with the kind's name.
    const words = e.text.startsWith(e.kind) || e.kind === "note" ? e.text : `${e.kind.replace("_", " ")}${e.text ? ": " + e.text : ""}`;
    button.append(frame, words);
    button.title = `${words}\n(${this.hint})`;
    button.onclick = () => this.open(e);
    row.dataset.frame = String(e.frame);
    row.dataset.time = String(e.time);
    row.append(button);
    return row;
  }
}
