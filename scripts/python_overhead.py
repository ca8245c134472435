#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What Python adds to a run: pairs of `dkb-slam run` and the same by the package, in turn.

    PYTHONPATH=build/python scripts/python_overhead.py build/apps/dkb-slam FOLDER [--pairs N]

Wall: from the first frame asked for to the end of finish(), as both measure it. CPU: of the whole process, outputs
included, less what starting Python and importing numpy take, which is printed. Prints the median of the pairs' ratios. The trajectories must have the same bytes.
"""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = """
import sys, time, dkb_slam
print(time.process_time())
source = dkb_slam.open(sys.argv[1])
slam = dkb_slam.Slam(source.camera, seed=1)
begin = time.perf_counter()
for frame in source:
    slam.process(frame)
slam.finish()
print(time.perf_counter() - begin)
slam.save_trajectory(sys.argv[2])
slam.save_map(sys.argv[2] + ".map")
"""


def cpu_of(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, default=7)
    arguments = parser.parse_args()
    wall, cpu = [], []
    with tempfile.TemporaryDirectory() as out:
        for pair in range(arguments.pairs):
            runs = {}
            for kind in ("program", "python") if pair % 2 == 0 else ("python", "program"):
                if kind == "program":
                    seconds, _ = cpu_of([arguments.program, "run", arguments.folder, "--out", out, "--quiet", "--seed", 1])
                    runs[kind] = json.loads(Path(out, "stats.json").read_text())["wall_s"], seconds
                else:
                    seconds, text = cpu_of([sys.executable, "-c", PROGRAM, arguments.folder, f"{out}/python.txt"])
                    start, loop = map(float, text.split())
                    runs[kind] = loop, seconds - start
            if Path(out, "trajectory.txt").read_bytes() != Path(out, "python.txt").read_bytes():
                sys.exit("error: the trajectories differ")
            wall.append(runs["python"][0] / runs["program"][0])
            cpu.append(runs["python"][1] / runs["program"][1])
            print(f"pair {pair}: wall {runs['program'][0]:.2f} s, {runs['python'][0]:.2f} s; "
                  f"CPU {runs['program'][1]:.2f} s, {runs['python'][1]:.2f} s and {start:.2f} s of start", flush=True)
    load = os.getloadavg()[0]
    print(f"median: wall x {statistics.median(wall):.3f}, CPU x {statistics.median(cpu):.3f} (load {load:.1f})")


if __name__ == "__main__":
    main()
