#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what the build, the tests and the benchmarks need from the distribution's packages (Debian 12, Ubuntu 22.04
# and newer). Does nothing, without touching the network, when all of it is there.
#
#   scripts/deps.sh          what `make demo`, `make test` and `make bench` need
#   scripts/deps.sh check    installs nothing: fails with one line when something is missing that `make build` needs
#   scripts/deps.sh python   what `make python` and `pip install .` need
#   scripts/deps.sh san      what `make test-san` needs
#   scripts/deps.sh docs     what `make docs` needs
#   scripts/deps.sh lint     the same and the tools of `make format` and `make lint`
#   scripts/deps.sh ros      what `make test` needs, and ROS 1 for the tests of its package
#   scripts/deps.sh slurm    the same and Slurm, for bench/slurm/one_node_cluster.sh
#
# DKB_SKIP_DEPS=1 skips the check: for machines where the libraries come from elsewhere.
set -euo pipefail

needed=(
  g++ cmake make ninja-build
  libeigen3-dev libpng-dev libjpeg-dev libyaml-cpp-dev nlohmann-json3-dev libfmt-dev libcli11-dev libnanoflann-dev
  libbz2-dev liblz4-dev libzstd-dev libsqlite3-dev  # recordings
  libdeflate-dev  # PNG files, faster than libpng alone
)
python=(python3-dev pybind11-dev python3-numpy python3-pytest)
packages=(
  "${needed[@]}" ccache pkg-config
  # Tests and benchmarks only: the frameworks, and the references that fast code is compared with.
  libgtest-dev libbenchmark-dev libceres-dev
  libopencv-core-dev libopencv-imgproc-dev libopencv-features2d-dev libopencv-video-dev libopencv-calib3d-dev
  libopencv-dnn-dev
  libopenni2-dev  # optional for users: cameras of that kind
  python3-rosbag python3-sensor-msgs python3-nav-msgs python3-tf2-msgs  # bags as ROS itself writes and reads them
  "${python[@]}" python3-pip python3-venv
)
# The live page: what bundles it, and the browser of its tests. Node from elsewhere serves as well; without them the page
# is plain and its tests are skipped.
if ! command -v node >/dev/null || ! command -v npm >/dev/null; then packages+=(nodejs npm); fi
if grep -qs '^ID=debian' /etc/os-release && ! command -v chromium >/dev/null; then packages+=(chromium-headless-shell); fi
clang=(clang llvm)  # llvm: names in what a sanitizer prints
if grep -qs '^ID=debian' /etc/os-release; then clang+=(libclang-rt-dev); fi  # elsewhere a part of clang
case "${1:-}" in
  "") ;;
  check) packages=("${needed[@]}") ;;
  python) packages=("${needed[@]}" "${python[@]}") ;;
  san) packages+=("${clang[@]}") ;;
  docs) packages=(doxygen) ;;
  ros)
    packages+=(
      catkin libroscpp-dev libtf2-ros-dev libnodeletlib-dev libnodeletlib-tools ros-message-generation ros-geometry-msgs
      ros-std-msgs libgeometry-msgs-dev libnav-msgs-dev libsensor-msgs-dev libvisualization-msgs-dev
      libdiagnostic-msgs-dev libstd-srvs-dev libtf2-msgs-dev rosout python3-roslaunch python3-std-msgs
      python3-geometry-msgs python3-visualization-msgs python3-diagnostic-msgs python3-std-srvs python3-pil
    )
    ;;
  lint) packages+=(clang-format clang-tidy cppcheck git) ;;
  slurm) packages+=(slurm-wlm munge) ;;
  *) echo "error: unknown argument \"$1\"; usage: scripts/deps.sh [check|python|san|docs|lint|ros|slurm]" >&2; exit 2 ;;
esac

if [[ "${DKB_SKIP_DEPS:-}" == 1 ]]; then
  echo "deps: not checked (DKB_SKIP_DEPS=1)"
  exit 0
fi
if [[ "${1:-}" == check ]] && ! command -v dpkg-query >/dev/null; then exit 0; fi  # CMake names what it does not find

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  {
    echo "error: this system has no apt-get, so the packages cannot be installed from here."
    echo "Install what corresponds to these Debian packages, then set DKB_SKIP_DEPS=1 and run the command again:"
    printf '  %s\n' "${packages[@]}"
  } >&2
  exit 1
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status} ' "$package" 2>/dev/null || true)
  [[ " $status" == *" installed "* ]] || missing+=("$package")
done
if [[ ${#missing[@]} -eq 0 ]]; then
  [[ "${1:-}" == check ]] || echo "deps: all packages are installed"
  exit 0
fi
if [[ "${1:-}" == check ]]; then
  echo "error: missing: ${missing[*]}; \`make deps\` installs them (DKB_SKIP_DEPS=1: they are there, from elsewhere)" >&2
  exit 1
fi

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    {
      echo "error: packages are missing, and installing them needs root or sudo. As root, run:"
      echo "  apt-get install --no-install-recommends ${missing[*]}"
    } >&2
    exit 1
  fi
  as_root=(sudo)
fi

echo "deps: installing ${missing[*]}"
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3)
"${apt[@]}" update -qq
"${apt[@]}" install -y -qq --no-install-recommends "${missing[@]}" </dev/null
echo "deps: done"
