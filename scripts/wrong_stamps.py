#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A sequence as a driver under load stamps it. Needs NumPy.

    scripts/wrong_stamps.py SEQUENCE OUT --bursts 3       # of three pairs the stamps are those of the last, 1 ms apart
    scripts/wrong_stamps.py SEQUENCE OUT --late 0.010     # each stamp is late by a time that is exponential, on average 10 ms

OUT has the images of SEQUENCE (links), an associations.txt with these stamps, and a groundtruth.txt that tells for each of them the
pose at the true one, so that a run of OUT is scored as usual. Deterministic.
"""
import argparse
import pathlib
import random

import numpy as np

APART = 0.001  # [s] stamps of a burst


def stamps_in_bursts(stamps, size):
    return [group[-1] - APART * (len(group) - 1 - i) for group in
            (stamps[k:k + size] for k in range(0, len(stamps), size)) for i in range(len(group))]


def late_stamps(stamps, mean):
    chance, late = random.Random(1), []
    for stamp in stamps:
        late.append(max(stamp + chance.expovariate(1 / mean), (late[-1] if late else 0) + APART / 2))
    return late


def poses_at(truth, stamps):
    """Truth between its stamps: places by lines, rotations by the normalised mean of quaternions of one sign."""
    rows = []
    for stamp in stamps:
        k = int(np.clip(np.searchsorted(truth[:, 0], stamp), 1, len(truth) - 1))
        before, after = truth[k - 1], truth[k].copy()
        if before[4:] @ after[4:] < 0:
            after[4:] = -after[4:]
        share = np.clip((stamp - before[0]) / (after[0] - before[0]), 0, 1)
        pose = (1 - share) * before[1:] + share * after[1:]
        pose[3:] /= np.linalg.norm(pose[3:])
        rows.append(pose)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    how = parser.add_mutually_exclusive_group(required=True)
    how.add_argument("--bursts", type=int)
    how.add_argument("--late", type=float)
    args = parser.parse_args()
    pairs = [line.split() for line in open(args.sequence / "associations.txt") if line.strip() and line[0] != "#"]
    truth = np.array([[float(v) for v in line.split()] for line in open(args.sequence / "groundtruth.txt")
                      if line.strip() and line[0] != "#"])
    true = [float(p[0]) for p in pairs]
    stamps = stamps_in_bursts(true, args.bursts) if args.bursts else late_stamps(true, args.late)
    args.out.mkdir(parents=True, exist_ok=True)
    for name in ("rgb", "depth", "camera.yaml"):
        there = (args.sequence / name).resolve()
        if there.exists() and not (args.out / name).exists():
            (args.out / name).symlink_to(there)
    with open(args.out / "associations.txt", "w") as file:
        file.writelines(f"{s:.6f} {p[1]} {s:.6f} {p[3]}\n" for s, p in zip(stamps, pairs))
    with open(args.out / "groundtruth.txt", "w") as file:
        file.writelines(f"{s:.6f} " + " ".join(f"{v:.6f}" for v in pose) + "\n"
                        for s, pose in zip(stamps, poses_at(truth, true)))


if __name__ == "__main__":
    main()
