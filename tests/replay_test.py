# SPDX-License-Identifier: Apache-2.0
"""Recorded sessions and `view` over HTTP: replay_test.py DKB_SLAM SEQUENCE.

What is recorded is what a live client was told, finished, running or cut off; what is refused; bad input.
"""
import json
import struct
import subprocess
import tempfile
import time
from pathlib import Path

from viewer_test import FRAMES, PROGRAM, SEQUENCE, Run, Served, Stream, results


class View(Served):
    def __init__(self, *words):
        super().__init__("view", *map(str, words), "--port", "0", "--quiet")

    def sessions(self, **headers):
        status, _, data = self.ask("/api/sessions", **headers)
        assert status == 200, status
        return json.loads(data)

    def bytes(self, n, start, end):
        status, _, data = self.ask(f"/api/session?n={n}&from={start}&to={end}")
        assert status == 200, (status, data)
        return data


def played(data, start=0):
    """What a client knows that begins at `start` and goes on to the end; the frames in order."""
    client, frames, at = Stream(), [], start
    while at < len(data):
        size, kind, magic, flags, _, frame, follow = struct.unpack_from("<II4sIdiI", data, at)
        assert (size, kind, magic) == (24, 13, b"DKBS")
        if not flags & 1 or at == start:
            client.buffer = data[at + 32:at + 32 + follow]
            client.split()
            frames.append(frame)
        at += 32 + follow
    assert at == len(data) and not client.buffer
    return client, frames


def refused(*words):
    done = subprocess.run([PROGRAM, "view", *map(str, words)], capture_output=True, text=True, timeout=20)
    assert done.returncode == 2 and done.stderr.startswith("error: ") and done.stderr.count("\n") == 1, (done.returncode, done.stderr)
    return done.stderr


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for name, more in (("plain", []), ("recorded", ["--record"])):
            assert Run(folder / name, *more, viewer=False).process.wait(120) == 0
        assert results(folder / "plain") == results(folder / "recorded"), "recording changes no byte of the results"
        assert not (folder / "plain/session.dkbs").exists()
        stats = json.loads((folder / "recorded/stats.json").read_text())

        view = View(folder / "recorded")
        state = view.state()
        assert state["replay"] and state["ended"] and state["frames"] == FRAMES, state
        (session,) = view.sessions()
        file = (folder / "recorded/session.dkbs").read_bytes()
        assert session["name"] == "recorded" and session["size"] == len(file) and session["ended"], session
        fetched = b""
        while len(fetched) < len(file):
            fetched += view.bytes(0, len(fetched), len(fetched) + 300000)
        assert fetched == file
        client, frames = played(fetched)
        assert frames == sorted(frames) and set(frames) >= set(range(FRAMES)), frames
        assert len(client.points) == stats["map_points"] and sum(client.keyframes.values()) == stats["keyframes"]
        assert client.facts == FRAMES and client.frames[-1]["state"]["ended"] and set(client.images) == {0, 1}
        for _, _, offset in session["entries"]:
            begun, _ = played(fetched, offset)
            assert begun.points == client.points and begun.keyframes == client.keyframes and begun.facts == FRAMES
        assert view.bytes(0, len(file), len(file) + 10) == b"" and view.bytes(0, 5, 5) == b""
        for query in ("n=1&from=0&to=9", "n=0&from=9&to=8", "n=0&from=-1&to=8", "n=0&to=8", "n=0&from=0&to=1e9", ""):
            assert view.status("/api/session?" + query) == 400, query
        assert view.status("/api/command", "POST", "{}") == 405 and view.status("/api/stream") == 404 and view.status("/") == 200
        assert view.status("/api/sessions", Host="evil.example") == 403
        code, err = view.end()
        assert code == 0 and err == "", (code, err)

        # A session that runs is seen as far as it is, and grows; who is let in from outside has the token.
        run = Run(folder / "running", "--record")
        run.order("pause")
        for _ in range(5):
            run.order("step")
        run.until(lambda s: s["paused"] and s["frame"] >= 4)
        view = Served("view", str(folder / "running"), str(folder / "recorded"), "--port", "0", "--viewer-host", "0.0.0.0")
        assert view.token and view.status("/api/sessions") == 401 and view.status("/api/session?n=0&from=0&to=8") == 401
        token = {"X-Dkb-Token": view.token}
        sessions = lambda: json.loads(view.ask("/api/sessions", **token)[2])
        before = sessions()[0]
        assert not before["ended"] and before["frames"] < FRAMES, before
        run.order("resume")
        end = time.time() + 60
        while not sessions()[0]["ended"]:
            assert time.time() < end, "the end is not seen"
            time.sleep(0.05)
        assert sessions()[0]["frames"] == FRAMES
        assert view.end()[0] == 0 and run.end()[0] == 0

        # A session that was killed, and a damaged file, are shown as far as they are whole.
        (folder / "cut").mkdir()
        (folder / "cut/session.dkbs").write_bytes(file[:len(file) // 2])
        (folder / "broken.dkbs").write_bytes(file[:200000] + bytes(1000) + file[201000:])
        view = View(folder / "cut", folder / "broken.dkbs")
        cut, broken = view.sessions()
        assert not cut["ended"] and 0 < cut["size"] <= len(file) // 2 and cut["frames"] > FRAMES // 4, cut
        assert broken["name"] == "broken" and 0 < broken["size"] <= len(file), broken
        played(view.bytes(0, 0, cut["size"]))
        assert view.end()[0] == 0

        assert "no such file" in refused(folder / "missing")
        assert "session.dkbs" in refused(folder / "plain")
        assert "not a recorded session" in refused(folder / "plain/report.html")
        (folder / "empty.dkbs").touch()
        assert "empty" in refused(folder / "empty.dkbs")
        (folder / "early.dkbs").write_bytes(file[:20])
        assert "cut off" in refused(folder / "early.dkbs")
        assert "--viewer-host" in refused(folder / "recorded", "--viewer-host", "no.such.host.invalid")
        refused(folder / "recorded", folder / "recorded", folder / "recorded")
        refused()

        # live records unless it is told not to.
        for name, more, there in (("live", [], True), ("unrecorded", ["--no-record"], False)):
            done = subprocess.run([PROGRAM, "live", f"fake:{SEQUENCE}", "--detector", "none", "--quiet", "--out", str(folder / name), *more],
                                  capture_output=True, text=True, timeout=120)
            assert done.returncode == 0 and (folder / name / "session.dkbs").exists() == there, (name, done)
    print("sessions are recorded and replayed as they should be")


if __name__ == "__main__":
    main()
