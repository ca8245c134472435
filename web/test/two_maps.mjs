// SPDX-License-Identifier: Apache-2.0
// A recorded session of two maps, as src/dkb/viewer/session_file.h and map_deltas.h lay it out. Frames 0 to 9 are in the
// first, a red square 2 m ahead; 10 to 19 in the second, a green one at the same place of a world of its own. With frame
// 20 the second is joined to the first, 3 m to its right; the camera stays there.
import { writeFileSync } from "node:fs";

export function writeTwoMaps(path, protocol = 2) {
  const message = (kind, ...parts) => {
    const body = Buffer.concat(parts.map((p) => Buffer.from(p))), head = Buffer.alloc(8);
    head.writeUInt32LE(body.length, 0);
    head.writeUInt32LE(kind, 4);
    return Buffer.concat([head, body]);
  };
  const keyframe = (id, root, x) => {
    const k = Buffer.alloc(40);
    k.writeInt32LE(id, 0);
    k.writeInt32LE(root, 4);
    [0, 0, 0, 1, x, 0, 0].forEach((v, i) => k.writeFloatLE(v, 12 + 4 * i));
    return message(2, k);
  };
  const points = (host, rgb) => {
    const n = 1600, list = Buffer.alloc(8 + 12 * n);
    list.writeUInt32LE(host, 0);
    list.writeUInt32LE(n, 4);
    for (let i = 0; i < n; i++) {
      const o = 8 + 12 * i;
      list.writeUInt16LE(i, o);
      [25 * (i % 40) - 500, 25 * Math.floor(i / 40) - 500, 2000].forEach((v, k) => list.writeInt16LE(v, o + 2 + 2 * k));
      rgb.forEach((v, k) => (list[o + 8 + k] = v));
      list[o + 11] = 3;
    }
    return message(3, list);
  };
  const place = (frame, host) => {
    const p = Buffer.alloc(20);
    p.writeUInt32LE(frame, 0);
    p.writeInt32LE(host, 4);
    p.writeFloatLE(0.02 * (frame % 10), 8);
    return message(6, p);
  };
  const chunks = [], frames = 30;
  for (let f = 0; f < frames; f++) {
    const host = f < 10 ? 0 : 1, root = f < 20 ? host : 0, messages = [];
    if (f === 0) messages.push(message(1, JSON.stringify({ protocol, source: "two maps", budget_ms: 33.3, unit: 0.001, feature_unit: 1,
      camera: { width: 640, height: 480, fx: 525, fy: 525, cx: 320, cy: 240 } })), keyframe(0, 0, 0), points(0, [255, 0, 0]));
    if (f === 10) messages.push(keyframe(1, 1, 0), points(1, [0, 255, 0]), place(f, -1));
    if (f === 20) messages.push(keyframe(1, 0, 3));
    messages.push(place(f, host));
    const json = JSON.stringify({ state: { frame: f, frames, tracked: f, lost: 0, state: "tracking", inliers: 400, keyframes: host + 1, map_points: 1600,
      loops: 0, movers: 0, tracking_ms: 12, paused: false, ended: f === frames - 1 }, explanation: "", map: root, camera: [0, 0, 0, 1, f < 20 ? 0 : 3, 0, 0], movers: [], boxes: [] });
    const padded = json + " ".repeat((4 - (json.length % 4)) % 4), length = Buffer.alloc(4);
    length.writeUInt32LE(padded.length);
    messages.push(message(8, JSON.stringify([{ kind: "note", frame: f, text: `event ${f}`, time: f / 30 }])), message(9, length, padded, Buffer.alloc(16)));
    messages.push(message(10, Buffer.alloc(4))); // a frame without images
    const body = Buffer.concat(messages), head = Buffer.alloc(32);
    head.writeUInt32LE(24, 0);
    head.writeUInt32LE(13, 4);
    head.write("DKBS", 8);
    head.writeUInt32LE(f === frames - 1 ? 2 : 0, 12);
    head.writeDoubleLE(f / 30, 16);
    head.writeInt32LE(f, 24);
    head.writeUInt32LE(body.length, 28);
    chunks.push(head, body);
  }
  writeFileSync(path, Buffer.concat(chunks));
}
