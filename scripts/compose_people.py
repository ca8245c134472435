#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Puts people into a sequence, in ways in which they take a camera along. Needs OpenCV's Python module, NumPy.

    scripts/compose_people.py SEQUENCE CUT_FROM OUT [--ways lead three ...]     # OUT/lead, OUT/three, ... in TUM layout
    scripts/compose_people.py --table build/apps/dkb-slam OUT [-- OPTIONS]      # runs all starts of what is in OUT, scores them

SEQUENCE: a still scene with groundtruth.txt, and camera.yaml where it is not of TUM's fr1. CUT_FROM: a composed sequence of fr1 with
masks/; three figures are cut out of its pairs 62, 95 and 155 by the mask and by depth, and stand before the camera as relief of that
one view. Each way moves them in the axes of the sequence's first camera (x right, y down, z ahead, metres). Depth gets the sensor's
noise and the shadow beside a body, and is missing nearer than 0.5 m. Deterministic.
"""
import json
import multiprocessing
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import cv2
import numpy as np

FR1 = {"fx": 517.3, "fy": 516.5, "cx": 318.6, "cy": 255.3, "depth_factor": 5000, "k1": 0.2624, "k2": -0.9531, "p1": -0.0054,
       "p2": 0.0026, "k3": 1.1633}
BASELINE, NEAREST = 0.075, 0.5  # [m] of the sensor


def camera_of(folder):
    if not (folder / "camera.yaml").exists():
        return FR1
    rows = (line.split(":") for line in open(folder / "camera.yaml") if ":" in line)
    return dict.fromkeys(FR1, 0) | {key: float(value.split("#")[0]) for key, value in rows if key in FR1}


def pairs_of(folder):
    return [line.split() for line in open(folder / "associations.txt") if not line.startswith("#")]


class Truth:
    def __init__(self, file):
        self.rows = np.array([[float(v) for v in line.split()] for line in open(file) if not line.startswith("#")])

    def at(self, stamp):
        """Rotation and place of the camera in the world."""
        i = np.clip(np.searchsorted(self.rows[:, 0], stamp), 1, len(self.rows) - 1)
        a, b = self.rows[i - 1], self.rows[i]
        s = np.clip((stamp - a[0]) / (b[0] - a[0]), 0, 1)
        q = (1 - s) * a[4:] + s * (b[4:] if a[4:] @ b[4:] > 0 else -b[4:])
        x, y, z, w = q / np.linalg.norm(q)
        rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                             [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                             [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        return rotation, (1 - s) * a[1:4] + s * b[1:4]


def cut_figure(folder, pair, mirrored=False, hue=0):
    """Points of a figure about its head and their colours."""
    row = pairs_of(folder)[pair]
    image, depth = cv2.imread(str(folder / row[1])), cv2.imread(str(folder / row[3]), -1) / FR1["depth_factor"]
    mask = cv2.imread(str(folder / "masks" / (pathlib.Path(row[1]).stem + ".png")), 0) > 0
    depth[depth == 0] = np.nan
    middle = np.nanmedian(depth[mask])
    mask &= ~(np.abs(depth - middle) > 0.22)
    mask = cv2.erode(mask.astype(np.uint8), np.ones((3, 3)))
    _, label, stats, _ = cv2.connectedComponentsWithStats(mask)
    mask = cv2.morphologyEx((label == 1 + np.argmax(stats[1:, 4])).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9)))
    depth = np.nan_to_num(depth, nan=middle)
    depth[np.abs(depth - middle) > 0.25] = middle
    depth = cv2.GaussianBlur(cv2.medianBlur(depth.astype(np.float32), 5), (0, 0), 3)
    if hue:
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        hsv[..., 0] = (hsv[..., 0].astype(int) + hue) % 180
        hsv[..., 1] = np.minimum(255, hsv[..., 1].astype(int) + 60)
        image = cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)
    ys, xs = np.nonzero(mask)
    top, left = ys.min(), xs.min()
    window = (slice(top, ys.max() + 1), slice(left, xs.max() + 1))

    def twice(a, how):
        return cv2.resize(a[window], None, fx=2, fy=2, interpolation=how)

    image, depth = twice(image, cv2.INTER_LINEAR), twice(depth, cv2.INTER_LINEAR)
    v, u = np.nonzero(twice(mask, cv2.INTER_NEAREST))
    z = depth[v, u]
    points = np.stack([(u / 2 + left - FR1["cx"]) / FR1["fx"] * z, (v / 2 + top - FR1["cy"]) / FR1["fy"] * z, z], 1)
    points -= [np.median(points[:, 0]), points[:, 1].min(), np.median(points[:, 2])]
    if mirrored:
        points[:, 0] *= -1
    return points, image[v, u]


def draw(figures, rotation, place, shape, camera):
    """Depth and colour of figures in the world, infinity where there are none."""
    height, width = shape
    nearest, colour = np.full(shape, np.inf), np.zeros((*shape, 3), np.uint8)
    for points, colours in figures:
        seen = (points - place) @ rotation
        ahead = seen[:, 2] > 0.15
        seen, colours = seen[ahead], colours[ahead]
        x, y = seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]
        inside = (np.abs(x) < 0.9) & (np.abs(y) < 0.75)
        order = np.flatnonzero(inside)[np.argsort(-seen[inside, 2])]
        seen, colours, x, y = seen[order], colours[order], x[order], y[order]
        r2, (k1, k2, p1, p2, k3) = x * x + y * y, (camera[k] for k in ("k1", "k2", "p1", "p2", "k3"))
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        u = camera["fx"] * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + camera["cx"]
        v = camera["fy"] * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + camera["cy"]
        one, one_colour = np.full(shape, np.inf), np.zeros_like(colour)
        for down in (0, 1):
            for right in (0, 1):
                a, b = np.floor(u).astype(int) + right, np.floor(v).astype(int) + down
                i = (a >= 0) & (a < width) & (b >= 0) & (b < height)
                one[b[i], a[i]], one_colour[b[i], a[i]] = seen[i, 2], colours[i]
        front = one < nearest
        nearest[front], colour[front] = one[front], one_colour[front]
    return nearest, colour


def along_line(times, places):
    return lambda t, camera: (np.array([np.interp(t, times, [p[i] for p in places]) for i in range(3)]), 0)


def with_camera(place, share):
    return lambda t, camera: (np.array(place) + share * camera, 0)


def swinging(place, by, speed, phase=0, turn=0, turn_speed=0):
    return lambda t, camera: (np.array(place) + np.array(by) * np.sin(speed * t + phase), turn * np.sin(turn_speed * t))


# Who goes how: (figure, place and turn at a time [s] with the camera's way [m]).
WAYS = {
    "lead": [("a", along_line([0, 1, 2.5, 4.5, 6, 9], [[-.05, -.25, .75], [-.05, -.25, .75], [.9, -.2, .8], [.9, -.2, .8],
                                                       [0, -.3, .7], [-.9, -.3, .7]]))],
    "along8": [("a", with_camera([.05, -.25, .75], .8))],
    "along5": [("a", with_camera([.1, -.25, .7], .5))],
    "alongm": [("a", with_camera([.1, -.25, .8], -.5))],
    "approach": [("a", along_line([0, 2, 4, 5.5, 7, 9], [[.1, -.3, 1.7], [0, -.25, .62], [0, -.25, .62], [.2, -.3, 1.5],
                                                         [0, -.25, .7], [-.8, -.3, .7]]))],
    "cross": [("a", swinging([0, -.25, .75], [.9, 0, 0], 1.6)), ("b", swinging([0, -.3, 1], [-.9, 0, 0], 1.6, .7))],
    "three": [("a", swinging([-.4, -.25, .85], [.35, 0, 0], 1.1)), ("b", swinging([0, -.25, .8], [.35, 0, 0], 1.1)),
              ("c", swinging([.4, -.25, .85], [.35, 0, 0], 1.1))],
    "sway": [("a", lambda t, camera: (np.array([.15 * np.sin(3 * t) - .02, -.25, .6 + .08 * np.sin(2.1 * t)]),
                                      .3 * np.sin(1.7 * t)))],
    "enter": [("b", along_line([0, .6, 1.1, 4.5, 5, 9], [[-1, -.3, .6], [-1, -.3, .6], [0, -.28, .6], [0, -.28, .6],
                                                         [.9, -.28, .6], [.9, -.28, .6]])),
              ("a", along_line([0, 5.5, 6, 8, 8.5, 9], [[1, -.25, .55], [1, -.25, .55], [.05, -.25, .55],
                                                        [.05, -.25, .55], [1, -.25, .55], [1, -.25, .55]]))],
    "turner": [("a", swinging([.05, -.25, .72], [0, 0, 0], 1, 0, .8, 1.5)),
               ("b", swinging([0, -.3, 1.05], [.5, 0, 0], .9, np.pi / 2, .5, 2))],
    "leave2": [("a", along_line([0, 2.5, 4, 9], [[-.15, -.25, .7], [-.15, -.25, .7], [-1, -.25, .8], [-1, -.25, .8]])),
               ("b", along_line([0, 2.5, 4, 9], [[.25, -.25, .75], [.25, -.25, .75], [-.6, -.25, .8], [-.9, -.25, .8]]))],
}


def place_figures(figures, way, truth, start, stamp):
    """The figures of a way in the world."""
    rotation, origin = truth.at(start)
    camera = (truth.at(stamp)[1] - origin) @ rotation
    placed = []
    for figure, goes in WAYS[way]:
        at, turn = goes(stamp - start, camera)
        (p, colours), c, s = figures[figure], np.cos(turn), np.sin(turn)
        turned = np.stack([c * p[:, 0] + s * p[:, 2], p[:, 1], c * p[:, 2] - s * p[:, 0]], 1)
        placed.append(((turned + at) @ rotation.T + origin, colours))
    return placed


def draw_before(room, figures, pose, camera):
    """Depth and colour of what stands before the room's depth, and where that is."""
    z, colour = draw(figures, *pose, room.shape, camera)
    mask = cv2.medianBlur((z < room).astype(np.uint8), 3) > 0
    return z, colour, mask & np.isfinite(z)


def compose(sequence, figures, way, out):
    random, truth, pairs = np.random.default_rng(1), Truth(sequence / "groundtruth.txt"), pairs_of(sequence)
    camera = camera_of(sequence)
    per_metre = camera["depth_factor"]
    for part in ("rgb", "depth", "masks"):
        (out / part).mkdir(parents=True, exist_ok=True)
    start = float(pairs[0][0])
    for row in pairs:
        image, depth = cv2.imread(str(sequence / row[1])), cv2.imread(str(sequence / row[3]), -1)
        behind = np.where(depth == 0, np.inf, depth / per_metre)
        around = cv2.erode(np.where(np.isfinite(behind), behind, 9), np.ones((9, 9)))

        room = np.where(depth == 0, around, behind)
        _, colour, mask = draw_before(room, place_figures(figures, way, truth, start, float(row[0])), truth.at(float(row[0])),
                                     camera)
        soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 0.8)[..., None] * mask[..., None]
        image = (colour * soft + image * (1 - soft)).astype(np.uint8)
        image[mask] = cv2.GaussianBlur(image, (0, 0), 0.7)[mask]
        cv2.imwrite(str(out / row[1]), image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        cv2.imwrite(str(out / "masks" / (pathlib.Path(row[1]).stem + ".png")), mask.astype(np.uint8) * 255)

        z, _, mask = draw_before(room, place_figures(figures, way, truth, start, float(row[2])), truth.at(float(row[2])), camera)
        noisy = np.where(mask, z, 0)
        noisy = noisy + random.normal(0, 1, z.shape) * (0.0012 + 0.0019 * (noisy - 0.4) ** 2)
        whole = cv2.erode(mask.astype(np.uint8), np.ones((3, 3))) > 0
        body = np.where(mask & whole & (noisy > NEAREST), np.clip(noisy * per_metre, 0, 65535), 0).astype(np.uint16)
        depth = np.where(mask, body, depth)
        for y, x in zip(*np.nonzero(mask & ~np.roll(mask, 1, 1))):
            far = behind[y, max(0, x - 6)]
            far = far if np.isfinite(far) else 1.5
            width = int(max(0, camera["fx"] * BASELINE * (1 / z[y, x] - 1 / max(far, z[y, x]))))
            depth[y, max(0, x - width):x] = 0
        cv2.imwrite(str(out / row[3]), depth)
    write_lists(out, pairs)
    for name in ("groundtruth.txt", "camera.yaml"):
        if (sequence / name).exists():
            shutil.copyfile(sequence / name, out / name)


def write_lists(folder, pairs):
    (folder / "associations.txt").write_text("".join(" ".join(row) + "\n" for row in pairs))
    (folder / "rgb.txt").write_text("".join(" ".join(row[:2]) + "\n" for row in pairs))
    (folder / "depth.txt").write_text("".join(" ".join(row[2:4]) + "\n" for row in pairs))


def error_mm(program, sequence, start, every, options):
    """APE of every nth pair from one pair on."""
    with tempfile.TemporaryDirectory() as scratch:
        data, out = pathlib.Path(scratch) / "data", pathlib.Path(scratch) / "out"
        data.mkdir()
        for name in ("rgb", "depth", "groundtruth.txt"):
            (data / name).symlink_to(sequence / name)
        write_lists(data, pairs_of(sequence)[start::every])
        camera = sequence / "camera.yaml"
        run = [program, "run", data, "--camera", camera if camera.exists() else "fr1", "--seed", start + 1, "--out", out, *options]
        subprocess.run([str(v) for v in run], check=True, stdin=subprocess.DEVNULL, capture_output=True)
        score = [program, "eval", data / "groundtruth.txt", out / "trajectory.txt", "--json", out / "score.json"]
        subprocess.run([str(v) for v in score], check=True, capture_output=True)
        return 1000 * json.load(open(out / "score.json"))["ape"]["translation_m"]["rmse"]


def table(program, folder, options):
    starts = [0, 8, 16, 24, 32, 48, 64]
    for sequence in sorted(p for p in folder.iterdir() if (p / "associations.txt").exists()):
        errors = {n: [error_mm(program, sequence.resolve(), s, n, options) for s in of]
                  for n, of in ((1, starts), (2, starts[::2]), (3, starts[1::3]))}
        capped = [min(e, 60) for of in errors.values() for e in of]
        print(f"{sequence.name:9} {np.mean(capped):5.1f} mm  ",
              "  ".join(f"{30 // n} Hz " + " ".join(f"{e:.1f}" for e in of) for n, of in errors.items()), flush=True)


def main():
    if len(sys.argv) >= 4 and sys.argv[1] == "--table":
        options = sys.argv[5:] if sys.argv[4:5] == ["--"] else ["--detector", "motion"]
        return table(sys.argv[2], pathlib.Path(sys.argv[3]), options)
    if len(sys.argv) < 4 or (len(sys.argv) > 4 and sys.argv[4] != "--ways"):
        sys.exit(__doc__)
    sequence, cut_from, out = (pathlib.Path(v) for v in sys.argv[1:4])
    ways = sys.argv[5:] or list(WAYS)
    if unknown := set(ways) - set(WAYS):
        sys.exit(f"--ways: there is no way {', '.join(sorted(unknown))}; there are {', '.join(WAYS)}")
    figures = {"a": cut_figure(cut_from, 95), "b": cut_figure(cut_from, 62, True, 60), "c": cut_figure(cut_from, 155, False, 110)}
    with multiprocessing.get_context("fork").Pool(os.cpu_count()) as pool:
        pool.starmap(compose, [(sequence, figures, way, out / way) for way in ways], chunksize=1)


if __name__ == "__main__":
    main()
