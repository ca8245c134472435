#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Format, clang-tidy on the library and the command line, cppcheck. Runs all three; fails on any finding.
#
#   scripts/lint.sh BUILD_FOLDER_WITH_COMPILE_COMMANDS [JOBS]
set -uo pipefail
build=$1
jobs=${2:-2}
result=0

echo "== clang-format"
git ls-files -z '*.cpp' '*.h' '*.inl' | xargs -0 clang-format --dry-run -Werror || result=1

echo "== clang-tidy"
sed -nE 's/^ *"file": "([^"]*)",?$/\1/p' "$build/compile_commands.json" | grep -E '/(src|apps)/' | grep -v '_test\.cpp$' | sort -u |
  xargs -P "$jobs" -d '\n' -n 1 clang-tidy --quiet -p "$build" 2> >(grep -v ' warnings\? generated' >&2) || result=1

echo "== cppcheck"
git ls-files 'src/*.cpp' 'apps/*.cpp' ':!*_test.cpp' |
  cppcheck --file-list=- -I src -I include --std=c++20 --language=c++ -j "$jobs" --quiet --inline-suppr \
    --enable=warning,performance,portability --suppress=internalAstError --suppress=unknownMacro \
    --error-exitcode=1 || result=1

[[ $result -eq 0 ]] && echo "lint: clean"
exit $result
