#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Simulates a short sequence with people in it, runs SLAM on it and scores the result.
#
#   scripts/demo.sh DKB_SLAM_EXECUTABLE OUTPUT_FOLDER
set -euo pipefail
dkb_slam=$1
out=$2
mkdir -p "$out"

echo "== a synthetic room with people walking through it"
"$dkb_slam" simulate --out "$out/sequence" --scene crowd --frames 150
echo "== SLAM"
"$dkb_slam" run "$out/sequence" --out "$out/result"
echo "== score against the exact path"
"$dkb_slam" eval "$out/sequence/groundtruth.txt" "$out/result/trajectory.txt" \
  --json "$out/score.json" --plot "$out/trajectory.svg" | tee "$out/score.txt"

first_frame=$(find "$out/sequence/rgb" -type f | sort | sed -n 1p)
echo
echo "pictures: $out/trajectory.svg (paths and error), $first_frame (first of the frames, more beside it)"
echo "map:      $out/result/map.ply"
echo "score:    $(grep -m 1 APE "$out/score.txt")"
