#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Frames dropped, latency and CPU of the ROS 2 node at 30 Hz beside `dkb-slam run --realtime` on the same frames.
#   measure.sh WORK SEQUENCE     WORK: where run.sh built the package; SEQUENCE: TUM fr1_xyz
set -euo pipefail
work=$(cd "$1" && pwd) sequence=$2
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
python3 "$here/../../test/respace.py" "$sequence" "$work/at30" 30 4
frames=$(wc -l <"$work/at30/associations.txt")
set +u
# shellcheck disable=SC1091
source "$work/install/share/dkb_slam_ros/local_setup.bash"
set -u
export LD_LIBRARY_PATH=$work/prefix/lib:$LD_LIBRARY_PATH ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=$((RANDOM % 100 + 1))
node=
trap 'kill -INT $node 2>/dev/null; wait' EXIT
for turn in 1 2 3; do
  echo "load: $(cut -d' ' -f1-3 /proc/loadavg)"
  "$work/install/lib/dkb_slam_ros/dkb_slam_node" --ros-args -r rgb/image:=/camera/color/image_raw \
    -r rgb/camera_info:=/camera/color/camera_info -r depth/image:=/camera/aligned_depth_to_color/image_raw \
    -p depth_factor:=5000.0 -p "base_from_cam:=[0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5]" >"$work/measure.log" 2>&1 &
  node=$!
  echo "node $turn: $(python3 "$here/measure_node.py" "$work/at30" "$frames" $node 517.3 516.5 318.6 255.3)"
  kill -INT $node
  wait $node
  rm -rf "$work/at30-run"
  "$work/prefix/bin/dkb-slam" run "$work/at30" --camera fr1 --realtime --out "$work/at30-run" --quiet
  python3 -c 'import json, sys; s = json.load(open(sys.argv[1])); print("run: frames", s["frames"], "skipped", s["skipped"], "tracking mean [ms]", round(s["stages"]["tracking"]["mean_ms"], 2), "cpu [s]", round(s["cpu_s"], 2))' "$work/at30-run/stats.json"
done
