#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The ROS 2 package for real, where one is sourced: built against the installed library, then started by its launch file,
# and once more as a component in a container; a second process plays a sequence to it over the loopback.
#   run.sh BUILD WORK REAL SIMULATED     BUILD: of the project; REAL: TUM fr1_xyz, whose place SIMULATED takes when it
#                                        is not there
set -euo pipefail
build=$1 work=$2 sequence=$3 frames=120 camera="517.3 516.5 318.6 255.3" depth_factor=5000.0
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

if [[ ${ROS_VERSION:-} != 2 ]] || ! command -v ros2 >/dev/null; then
  echo "skipped: no ROS 2 (source its setup.bash)"
  exit 0
fi
if [[ ! -d $sequence ]]; then
  sequence=$4 frames=40
  field() { sed -nE "s/^$1: *([0-9.eE+-]+).*/\1/p" "$sequence/camera.yaml"; }
  camera="$(field fx) $(field fy) $(field cx) $(field cy)" depth_factor=$(field depth_factor).0
fi

mkdir -p "$work"
work=$(cd "$work" && pwd)
cmake --install "$build" --prefix "$work/prefix" >"$work/install.log"
cmake -S "$here/../dkb_slam_ros" -B "$work/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix;${CMAKE_PREFIX_PATH//:/;}" \
  -DCMAKE_INSTALL_PREFIX="$work/install" -DPython3_EXECUTABLE="$(command -v python3)" \
  -DCMAKE_CXX_COMPILER_LAUNCHER="$(command -v ccache || true)" >"$work/configure.log" 2>&1 || { cat "$work/configure.log"; exit 1; }
cmake --build "$work/build" --target install -j "$(nproc)" >"$work/build.log" 2>&1 || { tail -40 "$work/build.log"; exit 1; }
set +u
# shellcheck disable=SC1091
source "$work/install/share/dkb_slam_ros/local_setup.bash"
set -u
export LD_LIBRARY_PATH=$work/prefix/lib:$LD_LIBRARY_PATH ROS_DOMAIN_ID=$((RANDOM % 100 + 1)) ROS_LOG_DIR=$work/log
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
if [[ ${ROS_DISTRO:-} == humble ]]; then export ROS_LOCALHOST_ONLY=1; fi

started=()
stop() {
  for ((i = ${#started[@]} - 1; i >= 0; --i)); do kill -INT "${started[i]}" 2>/dev/null || true; wait "${started[i]}" 2>/dev/null || true; done
  started=()
}
trap stop EXIT
cat >"$work/params.yaml" <<PARAMETERS
/**:
  ros__parameters:
    depth_factor: $depth_factor
    features.count: 900
    grid_period: 2.0
    queue_size: 200  # no machine is too slow for the test
PARAMETERS
check() {
  # shellcheck disable=SC2086
  python3 "$here/check_node.py" "$sequence" "$frames" "$work" $camera
  "$work/prefix/bin/dkb-slam" eval "$sequence/groundtruth.txt" "$work/odom.txt" --json "$work/eval.json" >"$work/eval.txt"
  python3 - "$work/eval.json" <<'ACCURACY'
import json
import sys
rmse = json.load(open(sys.argv[1]))["ape"]["translation_m"]["rmse"]
print(f"APE of odom: {1000 * rmse:.1f} mm")
sys.exit(0 if rmse < 0.03 else "FAILED: the odometry is off by more than 3 cm")
ACCURACY
}
arguments=(camera:=/camera handheld:=true params:="$work/params.yaml")

# In its own process group, so that an interrupt reaches the nodes as it does in a terminal.
setsid ros2 launch dkb_slam_ros rgbd.launch.py "${arguments[@]}" >"$work/node.log" 2>&1 &
launch=$!
started+=("$launch")
check || { tail -20 "$work/node.log"; exit 1; }
ros2 param describe --no-daemon --spin-time 5 /dkb_slam features.count tracking.close_depth
kill -INT -- "-$launch"
wait "$launch" || true
grep -q "process has finished cleanly" "$work/node.log" || { tail "$work/node.log"; echo "FAILED: the node did not stop cleanly"; exit 1; }

# A wrong parameter is refused by name.
if ros2 run dkb_slam_ros dkb_slam_node --ros-args -p features.count:=-5 >"$work/refused.log" 2>&1; then
  echo "FAILED: features.count -5 was taken"
  exit 1
fi
grep -q "features.count" "$work/refused.log" || { cat "$work/refused.log"; exit 1; }

# The component, in a container.
setsid ros2 run rclcpp_components component_container --ros-args -r __node:=container >"$work/container.log" 2>&1 &
container=$!
started+=("$container")
ros2 launch dkb_slam_ros rgbd.launch.py "${arguments[@]}" container:=/container >"$work/component.log" 2>&1 &
started+=($!)
check >"$work/component_check.log" 2>&1 || {
  cat "$work/component_check.log" "$work/container.log" "$work/component.log"
  exit 1
}
echo "component: $(grep failed "$work/component_check.log")"
kill -INT -- "-$container" || true
