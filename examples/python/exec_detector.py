#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A detector in a process of its own: whatever is of a strong orange belongs to the robot's own arm, and moves.

It needs numpy.

dkb-slam run FOLDER --detector "motion+exec:examples/python/exec_detector.py"
"""
import sys

import numpy

while header := sys.stdin.buffer.readline().split():  # frame NUMBER STAMP WIDTH HEIGHT
    number, width, height = int(header[1]), int(header[3]), int(header[4])
    pixels = numpy.frombuffer(sys.stdin.buffer.read(width * height * 3), numpy.uint8).reshape(height, width, 3)
    red, green, blue = pixels.astype(int).transpose(2, 0, 1)
    orange = (red > 150) & (red > green + 50) & (green > blue + 30)
    ys, xs = orange.nonzero()
    print(f"answer {number} {min(len(xs), 1)}")
    if len(xs):
        print(f"arm 1 {xs.min()} {ys.min()} {xs.max() - xs.min() + 1} {ys.max() - ys.min() + 1}")
        changes = numpy.flatnonzero(numpy.diff(orange.ravel(), prepend=False))  # where still and moving take turns
        print("mask", *numpy.diff(changes, prepend=0, append=orange.size))
    print("end", flush=True)
