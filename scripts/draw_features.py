#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws what became of each feature into frames of a sequence (needs OpenCV's Python module and NumPy).

  dkb-slam simulate --out sequence --scene crowd --frames 120
  dkb-slam run sequence --out result --dump-features
  scripts/draw_features.py sequence result/features.csv --frames 70 100 --out docs/images/crowd.png

Green: used by the pose or the map. Red: rejected, since it lies on something that moves. The rest is not drawn.
"""
import argparse
import collections
import csv
import pathlib
import sys

import cv2
import numpy as np

COLOURS = {"used": (60, 200, 60), "dynamic": (40, 40, 235)}  # BGR


def colour_files(sequence):
    """Stamp as written -> colour image, by the sequence's list."""
    folder = pathlib.Path(sequence)
    associations = folder / "associations.txt"
    list_file = associations if associations.exists() else folder / "rgb.txt"
    files = {}
    for line in list_file.read_text().splitlines():
        words = line.split()
        if len(words) >= 2 and not line.startswith("#"):
            files[words[0]] = folder / words[1]
    return files


def draw(image_file, features, scale):
    image = cv2.imread(str(image_file), cv2.IMREAD_COLOR)
    if image is None:
        sys.exit(f"error: {image_file}: cannot be read as an image")
    image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    image = (image & 0xF8) + 4  # sensor noise in the low bits makes half of a picture's bytes
    for state in ("used", "dynamic"):
        for x, y in features[state]:
            centre = (round(16 * scale * x), round(16 * scale * y))  # fixed point, 4 bits below the pixel
            cv2.circle(image, centre, 16 * 3, COLOURS[state], 1, cv2.LINE_AA, 4)
    return image


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", help="folder in TUM layout")
    parser.add_argument("features", help="features.csv of `dkb-slam run --dump-features`")
    parser.add_argument("--frames", type=int, nargs="+", default=[0], help="tracked frames, side by side; the first is 0")
    parser.add_argument("--scale", type=float, default=0.75, help="size of the drawing over that of the image")
    parser.add_argument("--out", required=True, help="picture to write (.png, .jpg)")
    arguments = parser.parse_args()

    by_stamp = {}
    with open(arguments.features, newline="") as file:
        for row in csv.DictReader(file):
            states = by_stamp.setdefault(row["timestamp"], collections.defaultdict(list))
            states[row["state"]].append((float(row["x"]), float(row["y"])))
    stamps = list(by_stamp)  # in the order of the file, which is that of time
    files = colour_files(arguments.sequence)
    if not all(0 <= f < len(stamps) for f in arguments.frames):
        sys.exit(f"error: --frames: {arguments.features} has the frames 0 ... {len(stamps) - 1}")
    pictures = [draw(files[stamps[f]], by_stamp[stamps[f]], arguments.scale) for f in arguments.frames]
    if not cv2.imwrite(arguments.out, np.hstack(pictures), [cv2.IMWRITE_PNG_COMPRESSION, 9]):
        sys.exit(f"error: {arguments.out}: cannot be written")


if __name__ == "__main__":
    main()
