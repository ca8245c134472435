#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Format, clang-tidy on the library and the command line, cppcheck. Fails on any finding.
#
#   scripts/lint.sh BUILD_FOLDER_WITH_COMPILE_COMMANDS [JOBS]
set -euo pipefail
build=$1
jobs=${2:-2}

echo "== clang-format"
git ls-files -z '*.cpp' '*.h' | xargs -0 clang-format --dry-run -Werror

echo "== clang-tidy"
git ls-files -z 'src/*.cpp' 'apps/*.cpp' ':!*_test.cpp' |
  xargs -0 -P "$jobs" -n 1 clang-tidy --quiet -p "$build"

if command -v cppcheck >/dev/null; then
  echo "== cppcheck"
  git ls-files 'src/*.cpp' 'apps/*.cpp' ':!*_test.cpp' |
    cppcheck --file-list=- -I src --std=c++20 --language=c++ -j "$jobs" --quiet --inline-suppr \
      --enable=warning,performance,portability --suppress=internalAstError --error-exitcode=1
fi
echo "lint: clean"
