#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Thirty minutes round and round a room: a closed path of two minutes is simulated, then tracked fifteen times in one
# go. Writes soak.md, soak.csv and soak.svg into OUT and takes about a quarter of an hour. Needs `make bench` (or
# BUILD, a build folder with benchmarks).
#   scripts/soak.sh OUT [ROUNDS]
set -euo pipefail

out=${1:?usage: scripts/soak.sh OUT [ROUNDS]}
rounds=${2:-15}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=${BUILD:-$root/build-bench}
mkdir -p "$out"

if [[ ! -f $out/sequence/associations.txt ]]; then # it is written last
  python3 "$root/scripts/soak.py" path "$out/path.txt"
  "$build/apps/dkb-slam" simulate --path "$out/path.txt" --frames 3600 --people 0 --out "$out/sequence"
fi
"$build/bench/soak_bench" --laps "$rounds" --csv "$out/soak.csv" "$out/sequence" | tee "$out/soak.md"
python3 "$root/scripts/soak.py" plot "$out/soak.csv" "$out/soak.svg"
