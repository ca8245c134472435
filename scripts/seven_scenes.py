#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes a sequence of Microsoft's 7-Scenes in TUM's layout. Needs OpenCV's Python module, NumPy.

    scripts/seven_scenes.py SEQUENCE OUT      # OUT: rgb/, depth/, their lists, camera.yaml, groundtruth.txt

SEQUENCE has frame-000000.color.png (or .jpg), .depth.png [mm] and .pose.txt (world from camera, KinectFusion's: it drifts by
centimetres). Its depth is that of the depth camera, 585 px: it is put into the colour camera, 525 px and 25 mm beside it. Stamps are
at 30 Hz.
"""
import pathlib
import shutil
import sys

import cv2
import numpy as np

WIDTH, HEIGHT, CENTRE = 640, 480, (320, 240)
COLOUR_FOCAL, DEPTH_FOCAL, BASELINE = 525.0, 585.0, 0.025  # [px, px, m]


def registered(depth):
    """Depth [m] as the colour camera has it: the nearest of what falls on a pixel."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    seen = (depth > 0) & (depth < 10)
    z = np.where(seen, depth, 1)
    x = np.rint(((u - CENTRE[0]) / DEPTH_FOCAL * z - BASELINE) / z * COLOUR_FOCAL + CENTRE[0]).astype(int)
    y = np.rint((v - CENTRE[1]) / DEPTH_FOCAL * COLOUR_FOCAL + CENTRE[1]).astype(int)
    seen &= (x >= 0) & (x < WIDTH) & (y >= 0) & (y < HEIGHT)
    nearest = np.full((HEIGHT, WIDTH), np.inf)
    np.minimum.at(nearest, (y[seen], x[seen]), depth[seen])
    return np.where(np.isfinite(nearest), nearest, 0)


def quaternion(r):
    """x, y, z, w of a rotation: the eigenvector of Bar-Itzhack (2000)."""
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0], [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)]])
    return np.linalg.eigh(k)[1][:, -1]  # eigh reads the lower triangle


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sequence, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    poses = sorted(sequence.glob("frame-*.pose.txt"))
    if not poses:
        sys.exit(f"{sequence}: there is no frame-*.pose.txt in it")
    for part in ("rgb", "depth"):
        (out / part).mkdir(parents=True, exist_ok=True)
    lists = {name: open(out / f"{name}.txt", "w") for name in ("rgb", "depth", "associations", "groundtruth")}
    for i, file in enumerate(poses):
        frame, stamp = file.name.removesuffix(".pose.txt"), f"{1000 + i / 30:.6f}"
        colour = next(p for p in (sequence / f"{frame}.color{end}" for end in (".png", ".jpg")) if p.exists())
        shutil.copyfile(colour, out / "rgb" / (stamp + colour.suffix))
        depth = cv2.imread(str(sequence / f"{frame}.depth.png"), -1)
        cv2.imwrite(str(out / "depth" / f"{stamp}.png"), np.rint(1000 * registered(depth / 1000)).astype(np.uint16))
        rgb, png = f"{stamp} rgb/{stamp}{colour.suffix}", f"{stamp} depth/{stamp}.png"
        pose = np.loadtxt(file)
        row = " ".join(f"{v:.6f}" for v in (*pose[:3, 3], *quaternion(pose[:3, :3])))
        for name, line in (("rgb", rgb), ("depth", png), ("associations", f"{rgb} {png}"), ("groundtruth", f"{stamp} {row}")):
            print(line, file=lists[name])
    camera = {"fx": COLOUR_FOCAL, "fy": COLOUR_FOCAL, "cx": CENTRE[0], "cy": CENTRE[1], "width": WIDTH, "height": HEIGHT,
              "depth_factor": 1000, "fps": 30}
    (out / "camera.yaml").write_text("".join(f"{key}: {value}\n" for key, value in camera.items()))


if __name__ == "__main__":
    main()
