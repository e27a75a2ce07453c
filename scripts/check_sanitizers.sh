#!/usr/bin/env bash
# The whole suite under AddressSanitizer and UndefinedBehaviorSanitizer. Takes about an hour on 2 cores.
set -euo pipefail
cd "$(dirname "$0")/.."
cmake --preset sanitize -DBUILD_TESTING=ON
cmake --build --preset sanitize
scripts/count_tests.sh build/sanitize
# what Mesa keeps until the process ends is not ours (tests/lsan_suppressions.txt)
export UBSAN_OPTIONS=print_stacktrace=1
ctest --preset sanitize --parallel "$(nproc)" --no-tests=error --output-junit "$PWD/build/sanitize/tests.xml" "$@"
python3 scripts/summarize_tests.py build/sanitize/tests.xml
