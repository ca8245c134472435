# SPDX-License-Identifier: Apache-2.0
"""`run --viewer` over HTTP: viewer_test.py DKB_SLAM SEQUENCE.

Who is let in, what is refused, that attackers do no harm, what the stream holds, that visitors steer the run, and that
they change nothing of its results.
"""
import http.client
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PROGRAM, SEQUENCE = sys.argv[1:3]
FRAMES = 40


class Served:
    def __init__(self, *words, viewer=True):
        self.process = subprocess.Popen([PROGRAM, *words], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        if viewer:
            line = self.process.stderr.readline()
            match = re.fullmatch(r"viewer: http://([^/:]+|\[[^]]*\]):(\d+)/(?:#token=([0-9a-f]{32}))?\n", line)
            assert match, line
            self.host, self.port, self.token = match.group(1), int(match.group(2)), match.group(3)

    def ask(self, path, method="GET", body=None, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        connection.request(method, path, body, {"Host": f"127.0.0.1:{self.port}", **headers})
        answer = connection.getresponse()
        data = answer.read()
        connection.close()
        return answer.status, dict(answer.getheaders()), data

    def status(self, *arguments, **headers):
        return self.ask(*arguments, **headers)[0]

    def state(self):
        return json.loads(self.ask("/api/state")[2])

    def order(self, what):
        assert self.status("/api/command", "POST", json.dumps({"do": what})) == 200, what

    def until(self, holds, seconds=60):
        end = time.time() + seconds
        while time.time() < end:
            state = self.state()
            if holds(state):
                return state
            time.sleep(0.02)
        raise AssertionError(f"never came: {state}")

    def end(self):
        self.process.send_signal(signal.SIGINT)
        code = self.process.wait(30)
        return code, self.process.stderr.read()


class Run(Served):
    def __init__(self, out, *more, viewer=True):
        self.out = Path(out)
        super().__init__("run", SEQUENCE, "--quiet", "--detector", "none", "--out", str(out), *(["--viewer", "0"] if viewer else []), *more,
                         viewer=viewer)

    def stream(self, query=""):
        connection = socket.create_connection(("127.0.0.1", self.port), timeout=20)
        connection.sendall(f"GET /api/stream{query} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        return Stream(connection)


class Stream:
    """Keeps what it is told, as the page does."""

    def __init__(self, connection=None):
        self.connection, self.buffer = connection, b""
        self.kinds, self.points, self.keyframes, self.frames, self.images, self.facts = {}, {}, {}, [], [], 0
        if connection is None:
            return
        while b"\r\n\r\n" not in self.buffer:
            self.buffer += connection.recv(65536)
        head, self.buffer = self.buffer.split(b"\r\n\r\n", 1)
        assert head.startswith(b"HTTP/1.1 200"), head

    def take(self, until, seconds=30):
        end = time.time() + seconds
        while not until(self):
            assert time.time() < end, f"never came; {self.kinds}"
            self.split()
            if until(self):
                return
            data = self.connection.recv(1 << 20)
            assert data, "the stream ended"
            self.buffer += data

    def split(self):
        while len(self.buffer) >= 8:
            size, kind = struct.unpack_from("<II", self.buffer)
            if len(self.buffer) < 8 + size:
                break
            self.message(kind, self.buffer[8:8 + size])
            self.buffer = self.buffer[8 + size:]

    def message(self, kind, data):
        self.kinds[kind] = self.kinds.get(kind, 0) + 1
        if kind == 2:
            for at in range(0, len(data), 40):
                self.keyframes[struct.unpack_from("<i", data, at)[0]] = struct.unpack_from("<I", data, at + 8)[0] == 0
        elif kind == 3:
            at = 0
            while at < len(data):
                host, n = struct.unpack_from("<II", data, at)
                at += 8
                for i in range(n):
                    index, seen = struct.unpack_from("<H", data, at)[0], data[at + 11]
                    if seen:
                        self.points[host, index] = struct.unpack_from("<hhh", data, at + 2)
                    else:
                        self.points.pop((host, index), None)
                    at += 12
        elif kind == 7:
            self.facts += len(data) // 16
        elif kind == 9:
            size = struct.unpack_from("<I", data)[0]
            self.frames.append(json.loads(data[4:4 + size]))
        elif kind == 10:
            assert data[4:6] == b"\xff\xd8", data[:8]
            self.images.append(struct.unpack_from("<I", data)[0])


def results(folder):
    names = ["trajectory.txt", "trajectory_online.txt", "keyframes.txt", "map.dkb", "map.ply", "config.yaml", "movers.csv"]
    return {name: (Path(folder) / name).read_bytes() for name in names}


def strangers_stay_out(run):
    status, headers, page = run.ask("/")
    assert status == 200 and b"<html" in page and headers["Content-Security-Policy"].startswith("default-src 'none'")
    assert run.status("/app.js") == 200 and run.status("/app.css") == 200
    for path in ("/nothing", "/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/app.js/../../x", "//etc/passwd"):
        assert run.status(path) == 404, path
    for host in ("evil.example", "127.0.0.1.evil.example", "192.168.1.1", ""):
        assert run.status("/", Host=host) in (400, 403), host
    assert run.status("/api/state", Origin="http://evil.example") == 403
    assert run.status("/api/state", **{"Sec-Fetch-Site": "cross-site"}) == 403
    for body in ("x" * 100000, "x" * 5000):
        assert run.status("/api/command", "POST", body) == 413
    for body in ('{"do":"rm"}', "", "[]", "{}", '{"do":1}', "[" * 4000, "\xff"):
        assert run.status("/api/command", "POST", body.encode("latin-1")) == 400, body
    assert run.status("/api/command", "POST", iter([b"{}"]), **{"Transfer-Encoding": "chunked"}) == 411
    assert run.status("/api/command") == 405 and run.status("/", "DELETE") == 405


def attackers_do_no_harm(run):
    idle = [socket.create_connection(("127.0.0.1", run.port)) for _ in range(500)]
    slow = [socket.create_connection(("127.0.0.1", run.port)) for _ in range(500)]
    for s in slow:
        try:
            s.sendall(b"GET / HTTP/1.1\r\nX: ")
        except OSError:
            pass  # closed already
    start = time.time()
    assert run.status("/") == 200
    assert time.time() - start < 2
    for s in idle + slow:
        s.close()
    # One byte at a time: closed before the request is whole.
    s = socket.create_connection(("127.0.0.1", run.port))
    start = time.time()
    try:
        while time.time() - start < 15:
            s.sendall(b"a")
            time.sleep(0.2)
    except OSError:
        pass
    assert 3 < time.time() - start < 10, time.time() - start
    assert run.status("/") == 200


def visitors_steer(run):
    run.until(lambda s: s["frame"] >= 2)
    run.order("pause")
    frame = run.until(lambda s: s["paused"])["frame"]
    time.sleep(0.3)
    frame = run.state()["frame"]
    time.sleep(0.5)
    assert run.state()["frame"] == frame, "it stands still"
    run.order("step")
    run.until(lambda s: s["frame"] == frame + 1)
    time.sleep(0.3)
    assert run.state()["frame"] == frame + 1, "one step, one frame"
    run.order("save_map")
    end = time.time() + 20
    while not (run.out / "map_saved.dkb").exists():
        assert time.time() < end, "the map is not saved"
        time.sleep(0.05)


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        without = Run(folder / "without", viewer=False)
        assert without.process.wait(120) == 0

        begun = time.time()
        run = Run(folder / "with", "--realtime")
        visitors_steer(run)
        paused = time.time()
        strangers_stay_out(run)
        attackers_do_no_harm(run)
        early, slow = run.stream("?images=1&depth=1"), run.stream("?images=1")
        early.take(lambda s: s.frames and len(s.images) >= 2 and s.points)
        assert set(early.images) == {0, 1} and early.frames[-1]["state"]["paused"]
        time.sleep(1)
        resumed = time.time()
        run.order("resume")
        end = run.until(lambda s: s["ended"])
        assert end["frame"] == FRAMES - 1 and end["tracked"] == FRAMES, end
        stats = json.loads((run.out / "stats.json").read_text())
        assert stats["skipped"] == 0, "the clock stood while it was paused"
        assert stats["wall_s"] < time.time() - begun - (resumed - paused), "a pause is no time of the run"
        late = run.stream()
        whole = lambda s: s.frames and s.frames[-1]["state"]["ended"] and len(s.points) == end["map_points"] and s.facts == FRAMES
        for s in (early, late, slow):
            s.take(whole)
            assert sum(s.keyframes.values()) == end["keyframes"]
        assert early.points == late.points == slow.points
        assert not late.images and late.kinds[1] == 1
        code, err = run.end()
        assert code == 0 and err == "", (code, err)

        # A dataset run: the same bytes, whoever looks on; and its end.
        run = Run(folder / "same", "--viewer-exit")
        try:
            watcher = run.stream("?images=1")
            watcher.take(lambda s: False)
        except (AssertionError, OSError):
            pass
        assert run.process.wait(60) == 0
        assert results(folder / "same") == results(folder / "without")

        run = Run(folder / "cut", "--realtime")
        run.order("pause")
        run.until(lambda s: s["paused"])
        code, _ = run.end()
        assert code == 130, code

        # Other machines need the token.
        run = Run(folder / "token", "--viewer-host", "0.0.0.0")
        assert run.token and run.host == "0.0.0.0"
        assert run.status("/") == 200 and run.status("/api/state") == 401 and run.status("/api/stream") == 401
        assert run.status("/api/state", **{"X-Dkb-Token": run.token[:-1] + "x"}) == 401
        assert run.status("/api/state", **{"X-Dkb-Token": run.token}) == 200
        assert run.status("/", Host="evil.example") == 403
        run.process.send_signal(signal.SIGINT)
        out, err = run.process.communicate(timeout=30)
        assert run.token not in out + err, "the token is printed once"

        taken = subprocess.run([PROGRAM, "run", SEQUENCE, "--viewer", "1", "--viewer-host", "no.such.host.invalid", "--out", str(folder / "x")],
                               capture_output=True, text=True)
        assert taken.returncode == 2 and "--viewer-host" in taken.stderr, taken.stderr
    print("the page is served as it should be")


if __name__ == "__main__":
    main()
