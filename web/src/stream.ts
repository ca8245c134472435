// SPDX-License-Identifier: Apache-2.0
// The server's stream: messages as src/dkb/viewer/map_deltas.h lays them out.

export const enum Kind {
  heartbeat, hello, keyframes, points, covisibility, loops, path, facts, events, frame, image, truth, pathReset,
  moment, stageNames, stages, surface, grid,
}
export const protocol = 2; // of the stream, as the hello tells it
export type Message = { kind: Kind; data: DataView };

export const token = new URLSearchParams(location.hash.slice(1)).get("token") ?? "";
export const headers: Record<string, string> = token ? { "X-Dkb-Token": token } : {};

const longest = 64 << 20; // no message of ours is longer

// Reads the stream until it ends or `signal` says so.
export async function readStream(url: string, signal: AbortSignal, take: (m: Message) => void): Promise<number> {
  const answer = await fetch(url, { headers, signal });
  if (!answer.ok || !answer.body) return answer.status;
  const reader = answer.body.getReader();
  let held = new Uint8Array(1 << 16);
  let size = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return answer.status;
    if (size + value.length > held.length) {
      const larger = new Uint8Array(Math.max(2 * held.length, size + value.length));
      larger.set(held.subarray(0, size));
      held = larger;
    }
    held.set(value, size);
    size += value.length;
    let at = 0;
    const view = new DataView(held.buffer);
    while (size - at >= 8) {
      const length = view.getUint32(at, true);
      if (length > longest) throw new Error("the stream is broken");
      if (size - at - 8 < length) break;
      // A copy: the numbers stay where they are while the buffer goes on.
      take({ kind: view.getUint8(at + 4), data: new DataView(held.slice(at + 8, at + 8 + length).buffer) });
      at += 8 + length;
    }
    held.copyWithin(0, at, size);
    size -= at;
    if (held.length > 4 << 20 && size < 1 << 20) held = held.slice(0, 1 << 20);
  }
}

export async function order(what: string): Promise<void> {
  await fetch("api/command", {
    method: "POST",
    headers: { ...headers, "Content-Type": "application/json" },
    body: JSON.stringify({ do: what }),
  });
}
