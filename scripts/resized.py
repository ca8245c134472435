#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A sequence as a camera of another resolution would have it. Needs NumPy and OpenCV.

    scripts/resized.py SEQUENCE 0.5 OUT --camera camera.yaml

OUT has the images of SEQUENCE at that scale, its lists and ground truth, and the camera of the file at that scale as its
camera.yaml. Colours are means or interpolated, depths are those of the nearest pixel. Deterministic.
"""
import argparse
import pathlib
import re
import shutil

import cv2

SCALED = {"fx": 0, "fy": 0, "cx": 0.5, "cy": 0.5}  # key: what is added before scaling, since pixel 0 reaches from -0.5 to 0.5


def scaled_camera(text, scale):
    for key, add in SCALED.items():
        text = re.sub(rf"^({key}:\s*)(\S+)", lambda m, add=add: f"{m[1]}{(float(m[2]) + add) * scale - add}", text, flags=re.M)
    return re.sub(r"^((?:width|height):\s*)(\S+)", lambda m: f"{m[1]}{round(int(m[2]) * scale)}", text, flags=re.M)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("scale", type=float)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--camera", type=pathlib.Path, help="the sequence's own camera.yaml unless given")
    args = parser.parse_args()
    camera = (args.camera or args.sequence / "camera.yaml").read_text()
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "camera.yaml").write_text(scaled_camera(camera, args.scale))
    for listed in args.sequence.glob("*.txt"):
        shutil.copyfile(listed, args.out / listed.name)
    smooth = cv2.INTER_AREA if args.scale < 1 else cv2.INTER_LINEAR
    for folder, way in (("rgb", smooth), ("depth", cv2.INTER_NEAREST)):
        (args.out / folder).mkdir(exist_ok=True)
        for path in sorted((args.sequence / folder).iterdir()):
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            cv2.imwrite(str(args.out / folder / path.name),
                        cv2.resize(image, None, fx=args.scale, fy=args.scale, interpolation=way))


if __name__ == "__main__":
    main()
