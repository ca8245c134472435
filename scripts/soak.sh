#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Cost against size, over hours: `room`, a closed path of two minutes round a room, tracked fifteen times in one go, or
# `building`, 200 m walked there and back ten times, 60,000 frames and thousands of keyframes. Writes soak.md, soak.csv
# and soak.svg into OUT and takes about a quarter of an hour. Needs `make bench` (or BUILD, a build folder with
# benchmarks).
#   scripts/soak.sh OUT [room|building] [ROUNDS]
set -euo pipefail

usage="usage: scripts/soak.sh OUT [room|building] [ROUNDS]"
out=${1:?$usage}
scene=${2:-room}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=${BUILD:-$root/build-bench}
mkdir -p "$out"

case $scene in
  room) rounds=15 more=() ;;
  building) rounds=10 more=(--there-and-back --detector motion) ;;
  *) echo "$usage" >&2 && exit 2 ;;
esac
if [[ ! -f $out/sequence/associations.txt ]]; then # it is written last
  if [[ $scene == room ]]; then
    python3 "$root/scripts/soak.py" path "$out/path.txt"
    "$build/apps/dkb-slam" simulate --path "$out/path.txt" --frames 3600 --people 0 --out "$out/sequence"
  else
    "$build/apps/dkb-slam" simulate --scene building --out "$out/sequence"
  fi
fi
"$build/bench/soak_bench" --rounds "${3:-$rounds}" "${more[@]}" --csv "$out/soak.csv" "$out/sequence" | tee "$out/soak.md"
python3 "$root/scripts/soak.py" plot "$out/soak.csv" "$out/soak.svg"
