#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the sensor's noise allows a camera's pose to be known to, and what a run made of it. Needs NumPy and Pillow.

  dkb-slam simulate --scene room --out room
  dkb-slam run room --detector motion --dump-features --out out
  scripts/bounds.py room out

The bound is that of Cramer and Rao for the pose of a single frame in a world that is known: the inverse of the Fisher
information of what stands still in it, by the simulator's masks. Points: the features that were used, each with a corner
of --corner pixels and, where it has one, a depth. Planes: every depth of a flat surface, with its distance along the
surface's normal. Depths have the noise of Nguyen, Izadi and Lovell (3DIMPVT 2012), all errors are independent. A map
that is made on the way is not known, so that no program can reach the bound; what is farther from it than its map is
worse than it need be. Frames in which a direction is left open by everything are counted and left out.
"""
import argparse
import csv
import pathlib
import sys

import numpy as np
from PIL import Image

BLOCK, STEP, FLAT, ENOUGH = 16, 4, 3.0, 12  # [px], [px], times the noise's variance, [blocks]: see PlaneFinder
OPEN = 1.0  # [m, rad] a direction known to no better than this is open


def depth_sigma(z):
    return 0.0012 + 0.0019 * (z - 0.4) ** 2


def read_rows(path):
    return [line.split() for line in open(path) if line.strip() and line[0] != "#"]


def read_camera(path):
    camera = {}
    for line in open(path):
        key, _, value = line.partition(":")
        camera[key.strip()] = float(value.split("#")[0])
    return camera


def skew(p):
    """For points (n, 3): (n, 3, 3) with skew(p) @ w = p x w."""
    m = np.zeros((len(p), 3, 3))
    m[:, 0, 1], m[:, 0, 2], m[:, 1, 2] = -p[:, 2], p[:, 1], -p[:, 0]
    return m - m.transpose(0, 2, 1)


def point_information(uv, depth, camera, corner):
    """Of [translation, rotation] in the camera's axes, by features at pixels `uv` and depths `depth`."""
    z = depth
    p = np.stack([(uv[:, 0] - camera["cx"]) / camera["fx"] * z, (uv[:, 1] - camera["cy"]) / camera["fy"] * z, z], 1)
    by_point = np.zeros((len(p), 3, 3))
    by_point[:, 0, 0], by_point[:, 0, 2] = camera["fx"] / z, -camera["fx"] * p[:, 0] / z**2
    by_point[:, 1, 1], by_point[:, 1, 2] = camera["fy"] / z, -camera["fy"] * p[:, 1] / z**2
    by_point[:, :2] /= corner
    by_point[:, 2, 2] = 1 / depth_sigma(z)
    jacobian = np.concatenate([by_point, -by_point @ skew(p)], 2)
    return np.einsum("nij,nik->jk", jacobian, jacobian)


def flat_surfaces(depth, still, camera):
    """Depths of flat surfaces as (n, 3) points and their (n, 3) normals: blocks are grown as PlaneFinder does."""
    h, w = depth.shape[0] // BLOCK, depth.shape[1] // BLOCK
    at = np.arange(BLOCK * max(h, w))[STEP // 2 :: STEP]
    v, u = np.meshgrid(at[: h * BLOCK // STEP], at[: w * BLOCK // STEP], indexing="ij")
    z = np.where(still[v, u], depth[v, u], 0)
    rays = np.stack([(u - camera["cx"]) / camera["fx"], (v - camera["cy"]) / camera["fy"], np.ones_like(z)], 2)

    def blocks(a):
        side = BLOCK // STEP
        return a.reshape(h, side, w, side, -1).transpose(0, 2, 1, 3, 4).reshape(h * w, side * side, -1)

    z, rays = blocks(z)[:, :, 0], blocks(rays)
    good = z > 0
    inverse = np.where(good, 1 / np.where(good, z, 1), 0)
    count = good.sum(1)
    mean = np.where(count > 0, z.sum(1) / np.maximum(count, 1), 1)
    weight = (mean**2 / depth_sigma(mean)) ** 2
    r = rays * good[:, :, None]
    square = np.einsum("bni,bnj->bij", r, r) * weight[:, None, None]
    product = np.einsum("bni,bn->bi", r, inverse) * weight[:, None]
    squares = (inverse**2).sum(1) * weight
    usable = count >= 12
    theta = np.zeros((h * w, 3))
    theta[usable] = np.linalg.solve(square[usable], product[usable][:, :, None])[:, :, 0]

    def misfit(b, t):
        return squares[b] - 2 * t @ product[b] + t @ square[b] @ t

    rest = np.array([misfit(b, theta[b]) / (count[b] - 3) if usable[b] else np.inf for b in range(h * w)])
    free = usable & (rest < FLAT)
    points, normals = [], []
    for seed in np.argsort(rest, kind="stable"):
        if not free[seed]:
            continue
        region, a, b, t = [seed], square[seed].copy(), product[seed].copy(), theta[seed]
        free[seed] = False
        for k in region:
            y, x = divmod(k, w)
            for yy, xx in ((y, x + 1), (y, x - 1), (y + 1, x), (y - 1, x)):
                n = yy * w + xx
                if not (0 <= yy < h and 0 <= xx < w) or not free[n]:
                    continue
                ray = square[n][:, 2] / square[n][2, 2]
                doubt = weight[n] * ray @ np.linalg.solve(a, ray)
                if misfit(n, t) > FLAT * count[n] * (1 + doubt):
                    continue
                free[n] = False
                region.append(n)
                a += square[n]
                b += product[n]
                t = np.linalg.solve(a, b)
        if len(region) < ENOUGH:
            continue
        on = good[region]
        points.append(z[region][on][:, None] * rays[region][on])
        normals.append(np.tile(t / np.linalg.norm(t), (on.sum(), 1)))
    if not points:
        return np.zeros((0, 3)), np.zeros((0, 3))
    return np.concatenate(points), np.concatenate(normals)


def plane_information(points, normals):
    # A depth's error is along the ray: of the distance from the plane it is n . ray times as much.
    rays = points / points[:, 2:]
    sigma = depth_sigma(points[:, 2]) * np.abs((normals * rays).sum(1))
    jacobian = np.concatenate([normals, np.cross(points, normals)], 1) / np.maximum(sigma, 1e-6)[:, None]
    # Every depth of a cell of STEP pixels says as much as the one that was looked at.
    return STEP * STEP * jacobian.T @ jacobian


def bound(information):
    """Standard deviations of place [m] and rotation [rad], or nothing where a direction is open."""
    values, vectors = np.linalg.eigh(information)
    if values[0] < 1 / OPEN**2:
        return None
    covariance = vectors @ np.diag(1 / values) @ vectors.T
    return np.sqrt(np.trace(covariance[:3, :3])), np.sqrt(np.trace(covariance[3:, 3:]))


def position_error(truth, estimate):
    """Root of the mean square after the best rigid alignment [m], and the number of poses."""
    at = np.searchsorted(truth[:, 0], estimate[:, 0] - 1e-3)
    at = np.minimum(at, len(truth) - 1)
    near = np.abs(truth[at, 0] - estimate[:, 0]) < 0.01
    q, p = truth[at[near], 1:4], estimate[near, 1:4]
    u, _, vt = np.linalg.svd((p - p.mean(0)).T @ (q - q.mean(0)))
    turn = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt).T
    return np.sqrt((((p - p.mean(0)) @ turn.T + q.mean(0) - q) ** 2).sum(1).mean()), int(near.sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("sequence", type=pathlib.Path, help="folder of dkb-slam simulate")
    parser.add_argument("run", type=pathlib.Path, help="folder of dkb-slam run --dump-features")
    parser.add_argument("--corner", type=float, default=0.4, help="[px] noise of a corner, as residuals show (0.4)")
    parser.add_argument("--every", type=int, default=10, help="[frames] from one that is looked at to the next (10)")
    arguments = parser.parse_args()
    for path in (arguments.sequence / "camera.yaml", arguments.sequence / "masks", arguments.run / "features.csv"):
        if not path.exists():
            sys.exit(f"{path}: not there; a simulated sequence and a run with --dump-features are needed")

    camera = read_camera(arguments.sequence / "camera.yaml")
    used = {}
    with open(arguments.run / "features.csv") as file:
        for row in csv.reader(file):
            if row[0][:1].isdigit() and row[3] == "used":
                used.setdefault(f"{float(row[0]):.6f}", []).append((float(row[1]), float(row[2])))
    names, found = ("points", "planes", "both"), {"points": [], "planes": [], "both": []}
    rows = read_rows(arguments.sequence / "associations.txt")[:: arguments.every]
    for row in rows:
        depth = np.asarray(Image.open(arguments.sequence / row[3])) / camera["depth_factor"]
        mask = arguments.sequence / "masks" / f"{float(row[0]):.6f}.png"
        still = np.asarray(Image.open(mask)) == 0 if mask.exists() else np.ones(depth.shape, bool)
        uv = np.array(used.get(f"{float(row[0]):.6f}", [])).reshape(-1, 2)
        x, y = np.rint(uv).astype(int).T
        own = (depth[y, x] > 0) & still[y, x]
        points = point_information(uv[own], depth[y, x][own], camera, arguments.corner)
        planes = plane_information(*flat_surfaces(depth, still, camera))
        for name, information in zip(names, (points, planes, points + planes)):
            found[name].append(bound(information))
    print(f"{len(rows)} frames of {arguments.sequence.name}: standard deviation of one frame's pose in a known world")
    for name in names:
        known = np.array([b for b in found[name] if b is not None]).reshape(-1, 2)
        if len(known) == 0:
            print(f"  {name:7s} open in every frame")
            continue
        place, turn = 1000 * np.sqrt((known**2).mean(0))
        print(f"  {name:7s} {place:6.2f} mm {turn:6.2f} mrad (root of the mean square); open in {len(rows) - len(known)}")
    truth = np.array(read_rows(arguments.sequence / "groundtruth.txt"), float)
    for name in ("trajectory_online.txt", "trajectory.txt"):
        error, poses = position_error(truth, np.array(read_rows(arguments.run / name), float))
        print(f"  {name}: {1000 * error:.2f} mm, {poses} poses")


if __name__ == "__main__":
    main()
