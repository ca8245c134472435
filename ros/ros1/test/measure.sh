#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Frames dropped, latency and CPU of the ROS 1 node at 30 Hz beside `dkb-slam run --realtime` on the same frames.
#   measure.sh WORK SEQUENCE     WORK: where run.sh built the package; SEQUENCE: TUM fr1_xyz
set -euo pipefail
work=$(cd "$1" && pwd) sequence=$2
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export PATH=/usr/bin:/bin
python3 "$here/../../test/respace.py" "$sequence" "$work/at30" 30 4
frames=$(wc -l <"$work/at30/associations.txt")
python3 "$here/make_bag.py" "$work/at30" "$work/at30.bag" "$frames" 517.3 516.5 318.6 255.3
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
export ROS_MASTER_URI=http://127.0.0.1:$port ROS_IP=127.0.0.1 ROS_HOME=$work/ros ROS_LOG_DIR=$work/log
roscore -p "$port" >"$work/roscore.log" 2>&1 &
core=$!
node=
trap 'kill -INT $node $core 2>/dev/null; wait' EXIT
until [[ $(python3 -c 'import rosgraph; print(rosgraph.is_master_online())') == True ]]; do sleep 0.2; done
python3 -c 'import rospy; rospy.set_param("/dkb_slam", {"base_from_cam": [0, 0, 0, -0.5, 0.5, -0.5, 0.5], "depth_factor": 5000.0})'
for turn in 1 2 3; do
  echo "load: $(cut -d' ' -f1-3 /proc/loadavg)"
  LD_LIBRARY_PATH=$work/build/devel/lib:$work/prefix/lib "$work/build/devel/lib/dkb_slam_ros/dkb_slam_node" \
    rgb/image:=/camera/color/image_raw rgb/camera_info:=/camera/color/camera_info \
    depth/image:=/camera/aligned_depth_to_color/image_raw >"$work/measure.log" 2>&1 &
  node=$!
  echo "node $turn: $(python3 "$here/measure_node.py" "$work/at30.bag" $node)"
  kill -INT $node
  wait $node
  rm -rf "$work/at30-run"
  "$work/prefix/bin/dkb-slam" run "$work/at30" --camera fr1 --realtime --out "$work/at30-run" --quiet
  python3 -c 'import json, sys; s = json.load(open(sys.argv[1])); print("run: frames", s["frames"], "skipped", s["skipped"], "tracking mean [ms]", round(s["stages"]["tracking"]["mean_ms"], 2), "cpu [s]", round(s["cpu_s"], 2))' "$work/at30-run/stats.json"
done
