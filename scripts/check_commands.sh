#!/usr/bin/env bash
# The README's two commands in a clone of the last commit: in either order, twice, and after each other. Each must find
# every test of the suite, whatever the other left in the build folder.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
git clone --quiet . "$folder/clone"
cd "$folder/clone"
unset AMRTEX_PRESET
# the tests themselves run elsewhere; here one stands for all, after test.sh has counted them
run_tests() { scripts/test.sh -- -R '^Statistics\.' >"$folder/log" 2>&1 || { tail -n 40 "$folder/log" >&2; exit 1; }; }
run_demo() { scripts/demo.sh >"$folder/log" 2>&1 || { tail -n 40 "$folder/log" >&2; exit 1; }; }
for command in run_demo run_tests run_tests run_demo run_demo run_tests; do
  $command
  echo "$command: passed"
done
# a cache that says that there are no tests, as an earlier demo.sh left it
cmake --preset release -DBUILD_TESTING=OFF >/dev/null
run_tests
echo "run_tests after BUILD_TESTING=OFF: passed"
