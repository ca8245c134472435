#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A sequence in TUM layout as a camera at a fixed rate would have seen it: respace.py FOLDER OUT RATE TIMES

Links to the images of FOLDER's pairs, played forwards and backwards TIMES times, colour and depth at the same stamps.
"""
import os
import sys

folder, out, rate, times = os.path.abspath(sys.argv[1]), sys.argv[2], float(sys.argv[3]), int(sys.argv[4])
rows = [line.split() for line in open(folder + "/associations.txt") if not line.startswith("#")]
order = []
for turn in range(times):
    order += rows if turn % 2 == 0 else rows[::-1]
os.makedirs(out + "/rgb", exist_ok=True)
os.makedirs(out + "/depth", exist_ok=True)
with open(out + "/associations.txt", "w") as pairs, open(out + "/rgb.txt", "w") as rgb, open(out + "/depth.txt", "w") as depth:
    for i, row in enumerate(order):
        stamp = f"{1000 + i / rate:.6f}"
        names = []
        for image, kind in ((row[1], "rgb"), (row[3], "depth")):
            names.append(f"{kind}/{stamp}{os.path.splitext(image)[1]}")
            if not os.path.islink(f"{out}/{names[-1]}"):
                os.symlink(f"{folder}/{image}", f"{out}/{names[-1]}")
        pairs.write(f"{stamp} {names[0]} {stamp} {names[1]}\n")
        rgb.write(f"{stamp} {names[0]}\n")
        depth.write(f"{stamp} {names[1]}\n")
print(f"{out}: {len(order)} frames")
