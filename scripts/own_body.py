#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A sequence as a robot would have it that sees a part of itself, or whose lens is dirty. Needs NumPy and OpenCV.

    scripts/own_body.py SEQUENCE body|dirt OUT --camera camera.yaml

`body`: a patterned arm 0.45 m away in the lower third of each image. `dirt`: 60 patterned spots of 8 to 24 px, which the depth
image does not see. OUT has SEQUENCE's lists, ground truth and images, mask.png, which is above 0 there, and two camera files:
camera.yaml without it and masked.yaml with it. Deterministic.
"""
import argparse
import pathlib
import shutil

import cv2
import numpy as np

ARM = [[0, 1], [0, 0.83], [0.19, 0.69], [0.47, 0.75], [0.66, 0.62], [0.88, 0.73], [1, 0.88], [1, 1]]  # of width and height


def mask_of(kind, width, height, random):
    mask = np.zeros((height, width), np.uint8)
    if kind == "body":
        cv2.fillPoly(mask, [np.round(np.array(ARM) * [width - 1, height - 1]).astype(np.int32)], 255)
    else:
        for x, y, radius in zip(random.integers(width, size=60), random.integers(height, size=60), random.integers(4, 13, size=60)):
            cv2.circle(mask, (int(x), int(y)), int(radius), 255, -1)
    return mask


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("kind", choices=["body", "dirt"])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--camera", type=pathlib.Path, help="the sequence's own camera.yaml unless given")
    args = parser.parse_args()
    random = np.random.default_rng(3)
    camera = (args.camera or args.sequence / "camera.yaml").read_text()
    for folder in ("rgb", "depth"):
        (args.out / folder).mkdir(parents=True, exist_ok=True)
    for listed in args.sequence.glob("*.txt"):
        (args.out / listed.name).write_text(listed.read_text().replace(".jpg", ".png"))
    (args.out / "camera.yaml").write_text(camera)
    (args.out / "masked.yaml").write_text(camera.rstrip("\n") + "\nmask: mask.png\n")
    mask = pattern = None
    for path in sorted((args.sequence / "rgb").iterdir()):
        image = cv2.imread(str(path))
        if mask is None:
            height, width = image.shape[:2]
            mask = mask_of(args.kind, width, height, random)
            cv2.imwrite(str(args.out / "mask.png"), mask)
            blobs = cv2.GaussianBlur(random.integers(256, size=(height, width)).astype(np.uint8), (0, 0), 2)
            pattern = cv2.normalize(blobs, None, 20, 235, cv2.NORM_MINMAX)[mask > 0].astype(float)
        noisy = np.clip(pattern + random.normal(0, 3, pattern.shape), 0, 255)
        image[mask > 0] = noisy[:, None].astype(np.uint8)
        cv2.imwrite(str(args.out / "rgb" / (path.stem + ".png")), image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    for path in sorted((args.sequence / "depth").iterdir()):
        if args.kind == "dirt":
            shutil.copyfile(path, args.out / "depth" / path.name)
            continue
        depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        depth[mask > 0] = 2250 + random.integers(-6, 7, np.count_nonzero(mask))  # 5000 a metre
        cv2.imwrite(str(args.out / "depth" / path.name), depth, [cv2.IMWRITE_PNG_COMPRESSION, 1])


if __name__ == "__main__":
    main()
