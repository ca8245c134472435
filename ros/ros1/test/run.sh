#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The ROS 1 package for real: built against the installed library, then as a node and as a nodelet on a roscore of its
# own, fed with a bag over the loopback.
#   run.sh BUILD WORK REAL SIMULATED     BUILD: of the project; REAL: TUM fr1_xyz, whose place SIMULATED takes when it
#                                        is not there
set -euo pipefail
build=$1 work=$2 sequence=$3 frames=120 camera="517.3 516.5 318.6 255.3" depth_factor=5000
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export PATH=/usr/bin:/bin  # the Python that ROS' modules are installed for

for needed in roscore rosbag cmake; do
  if ! command -v $needed >/dev/null || ! pkg-config --exists roscpp; then
    echo "skipped: no ROS 1 ($needed or roscpp is missing; scripts/deps.sh installs them)"
    exit 0
  fi
done

if [[ ! -d $sequence ]]; then
  sequence=$4 frames=40
  field() { sed -nE "s/^$1: *([0-9.eE+-]+).*/\1/p" "$sequence/camera.yaml"; }
  camera="$(field fx) $(field fy) $(field cx) $(field cy)" depth_factor=$(field depth_factor)
fi

mkdir -p "$work"
work=$(cd "$work" && pwd)
cmake --install "$build" --prefix "$work/prefix" >"$work/install.log"
cmake -S "$here/../dkb_slam_ros" -B "$work/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix" \
  -DCMAKE_CXX_COMPILER_LAUNCHER="$(command -v ccache || true)" >"$work/configure.log" 2>&1 || { cat "$work/configure.log"; exit 1; }
cmake --build "$work/build" -j "$(nproc)" >"$work/build.log" 2>&1 || { tail -40 "$work/build.log"; exit 1; }

# shellcheck disable=SC2016
free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
port=$(free_port)
export ROS_MASTER_URI=http://127.0.0.1:$port ROS_IP=127.0.0.1 ROS_HOME=$work/ros ROS_LOG_DIR=$work/log
export ROS_PACKAGE_PATH=$here/../dkb_slam_ros:/usr/share PYTHONPATH=$work/build/devel/lib/python3/dist-packages
export CMAKE_PREFIX_PATH=$work/build/devel LD_LIBRARY_PATH=$work/build/devel/lib:$work/prefix/lib
started=()
stop() {
  for ((i = ${#started[@]} - 1; i >= 0; --i)); do kill -INT "${started[i]}" 2>/dev/null || true; wait "${started[i]}" 2>/dev/null || true; done
  started=()
}
trap stop EXIT

python3 "$here/check_launch.py"

# shellcheck disable=SC2086
python3 "$here/make_bag.py" "$sequence" "$work/test.bag" "$frames" $camera
roscore -p "$port" >"$work/roscore.log" 2>&1 &
started+=($!)
until [[ $(python3 -c 'import rosgraph; print(rosgraph.is_master_online())') == True ]]; do sleep 0.2; done

remaps=(rgb/image:=/camera/color/image_raw rgb/camera_info:=/camera/color/camera_info
  depth/image:=/camera/aligned_depth_to_color/image_raw)
python3 - "$depth_factor" "$(free_port)" <<'PARAMETERS'
import sys
import rospy
rospy.set_param("/dkb_slam", {"base_from_cam": [0, 0, 0, -0.5, 0.5, -0.5, 0.5], "depth_factor": float(sys.argv[1]),
                              "features": {"count": 900}, "grid_period": 2.0, "viewer_port": int(sys.argv[2]),
                              "queue_size": 200})  # no machine is too slow for the test
PARAMETERS
"$work/build/devel/lib/dkb_slam_ros/dkb_slam_node" "${remaps[@]}" >"$work/node.log" 2>&1 &
started+=($!)
node=$!
python3 "$here/check_node.py" "$work/test.bag" "$frames" "$work" || { tail -20 "$work/node.log"; exit 1; }
kill -INT "$node"
wait "$node" || { echo "FAILED: the node did not stop cleanly"; exit 1; }
# The base has the camera's place, so its path is the camera's.
"$work/prefix/bin/dkb-slam" eval "$sequence/groundtruth.txt" "$work/odom.txt" --json "$work/eval.json" >"$work/eval.txt"
python3 - "$work/eval.json" <<'ACCURACY'
import json
import sys
rmse = json.load(open(sys.argv[1]))["ape"]["translation_m"]["rmse"]
print(f"APE of odom: {1000 * rmse:.1f} mm")
sys.exit(0 if rmse < 0.03 else "FAILED: the odometry is off by more than 3 cm")
ACCURACY

# A wrong parameter is refused by name.
python3 -c 'import rospy; rospy.set_param("/dkb_slam/features/count", -5)'
if "$work/build/devel/lib/dkb_slam_ros/dkb_slam_node" "${remaps[@]}" >"$work/refused.log" 2>&1; then
  echo "FAILED: features.count -5 was taken"
  exit 1
fi
grep -q "features.count" "$work/refused.log" || { cat "$work/refused.log"; exit 1; }
python3 -c 'import rospy; rospy.set_param("/dkb_slam/features/count", 900)'

# The nodelet, in a manager.
/usr/lib/nodelet/nodelet manager __name:=manager >"$work/manager.log" 2>&1 &
started+=($!)
/usr/lib/nodelet/nodelet load dkb_slam_ros/SlamNodelet manager __name:=dkb_slam "${remaps[@]}" >"$work/nodelet.log" 2>&1 &
started+=($!)
python3 "$here/check_node.py" "$work/test.bag" "$frames" "$work" >"$work/nodelet_check.log" 2>&1 || {
  cat "$work/nodelet_check.log" "$work/manager.log" "$work/nodelet.log"
  exit 1
}
echo "nodelet: $(tail -1 "$work/nodelet_check.log")"
