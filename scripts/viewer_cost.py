#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What the live page costs a run: viewer_cost.py DKB_SLAM SEQUENCE [PAIRS] [RUN OPTIONS ...]

Runs in turn without the page and with it, a client reading all that is sent, images too. Prints tracking's mean and 95th
percentile of each run, the medians of both kinds, and what the client received a second with and without images.
"""
import json
import re
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

program, sequence, pairs, more = sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 5, sys.argv[4:]


def run(folder, page):
    out = Path(folder) / ("with" if page else "without")
    command = [program, "run", sequence, "--realtime", "--quiet", "--out", str(out), *more, *(["--viewer", "0", "--viewer-exit"] if page else [])]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    kinds = {}
    seconds = 1
    if page:
        port = int(re.search(r":(\d+)/", process.stderr.readline()).group(1))
        client = socket.create_connection(("127.0.0.1", port))
        client.sendall(b"GET /api/stream?images=1 HTTP/1.1\r\nHost: localhost\r\n\r\n")
        start, data = time.time(), b""
        while b"\r\n\r\n" not in data:
            data += client.recv(65536)
        data = bytearray(data.split(b"\r\n\r\n", 1)[1])
        while True:
            try:
                piece = client.recv(1 << 20)
            except OSError:
                break
            if not piece:
                break
            data += piece
            while len(data) >= 8 and len(data) >= 8 + struct.unpack_from("<I", data)[0]:
                size, kind = struct.unpack_from("<II", data)
                kinds[kind] = kinds.get(kind, 0) + 8 + size
                del data[:8 + size]
        seconds = time.time() - start
    process.wait()
    stats = json.loads((out / "stats.json").read_text())
    tracking = stats["stages"]["tracking"]
    return tracking["mean_ms"], tracking["p95_ms"], stats["cpu_s"], {k: v / seconds for k, v in kinds.items()}


results = {False: [], True: []}
with tempfile.TemporaryDirectory() as folder:
    for i in range(pairs):
        for page in ([False, True] if i % 2 == 0 else [True, False]):
            mean, p95, cpu, rates = run(folder, page)
            results[page].append((mean, p95, cpu))
            if page:
                last = rates
            print(f"{'with   ' if page else 'without'}  mean {mean:6.2f} ms  p95 {p95:6.2f} ms  cpu {cpu:6.2f} s", flush=True)
middle = {page: [statistics.median(column) for column in zip(*rows)] for page, rows in results.items()}
for i, name in enumerate(("mean", "p95", "cpu")):
    print(f"{name}: {middle[False][i]:.2f} without, {middle[True][i]:.2f} with: {100 * (middle[True][i] / middle[False][i] - 1):+.1f} %")
images = last.get(10, 0)
print(f"a second: {(sum(last.values()) - images) / 1e6:.3f} MB without images, {images / 1e6:.3f} MB of images; by kind of message {({k: round(v) for k, v in sorted(last.items())})}")
