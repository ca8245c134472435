#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Puts ONNX Runtime's shared library into a folder. It comes from the npm package that packaging/onnxruntime locks, for
# Linux on x86-64 and 64-bit ARM; nothing of the package is run. Does nothing, without touching the network, when it is
# there.
#
#   scripts/onnxruntime.sh OUTPUT_FOLDER
set -euo pipefail
out=$1
from=$(dirname "${BASH_SOURCE[0]}")/../packaging/onnxruntime

if cmp -s "$from/package-lock.json" "$out/package-lock.json" && [[ -f "$out/libonnxruntime.so.1" ]]; then
  echo "onnxruntime: $out/libonnxruntime.so.1 is there"
  exit 0
fi
case "$(uname -s) $(uname -m)" in
  "Linux x86_64") machine=linux/x64 ;;
  "Linux aarch64") machine=linux/arm64 ;;
  *) echo "error: the npm package has no ONNX Runtime for $(uname -sm); name a library of your own in DKB_ONNXRUNTIME" >&2; exit 1 ;;
esac
if ! command -v npm >/dev/null; then
  echo "error: npm is not here; install it (apt-get install nodejs npm), or name a library of your own in DKB_ONNXRUNTIME" >&2
  exit 1
fi

work=$out/npm
rm -rf "$work"
trap 'rm -rf "$work"' EXIT
mkdir -p "$work"
cp "$from/package.json" "$from/package-lock.json" "$work/"
if ! (cd "$work" && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error --fetch-retries=2 --fetch-retry-mintimeout=1000 \
        --fetch-retry-maxtimeout=5000 --fetch-timeout=60000); then
  echo "error: npm could not fetch ONNX Runtime; with the network, run \`make onnxruntime\` again" >&2
  exit 1
fi
cp "$work"/node_modules/onnxruntime-node/bin/napi-*/"$machine"/libonnxruntime.so.1 "$out/libonnxruntime.so.1.new"
mv "$out/libonnxruntime.so.1.new" "$out/libonnxruntime.so.1"
cp "$from/package-lock.json" "$out/package-lock.json"
echo "onnxruntime: $out/libonnxruntime.so.1, MIT licence"
