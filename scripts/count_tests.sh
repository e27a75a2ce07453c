#!/usr/bin/env bash
# Is the suite complete? Compares the number of tests that a build folder knows with the floor in tests/count_floor:
# a suite that lost its tests must not pass.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:?usage: scripts/count_tests.sh BUILD_FOLDER}
floor=$(cat tests/count_floor)
count=$(ctest --test-dir "$folder" --show-only | sed -n 's/^Total Tests: //p')
if [ "${count:-0}" -lt "$floor" ]; then
  echo "scripts/count_tests.sh: $folder knows ${count:-0} tests, at least $floor are expected (tests/count_floor)" >&2
  exit 1
fi
echo "$count tests"
