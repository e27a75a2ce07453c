#!/usr/bin/env bash
# Installs what is missing, builds, and runs the tests: a sample of everything, in minutes.
#   scripts/test.sh           what each change must pass
#   scripts/test.sh --full    every combination, then the sanitizers, the compilers of Debian 13 in a bare root, both
#                             commands of the README in a clone, planted faults and the rehearsal of gpu_check.sh; a missing optional
#                             package is a failure
#   scripts/test.sh -- ARGS   ARGS go to ctest: `scripts/test.sh -- -L reference`
# AMRTEX_PRESET names the configure preset: `release`, or `ci`, where warnings are errors.
set -euo pipefail
cd "$(dirname "$0")/.."

full=no
while [ $# -gt 0 ]; do
  case $1 in
    --full) full=yes; shift ;;
    --) shift; break ;;
    *) echo "scripts/test.sh: no argument '$1'; accepted: --full, -- and arguments of ctest" >&2; exit 2 ;;
  esac
done
preset=${AMRTEX_PRESET:-release}

if [ $full = yes ]; then scripts/setup.sh --full; else scripts/setup.sh; fi
# the cache of an earlier configuration may say otherwise
cmake --preset "$preset" -DBUILD_TESTING=ON
cmake --build --preset "$preset"
scripts/count_tests.sh "build/$preset"

# from Mesa 25 on zink takes handles of textures on the CPU: skipping their tests would hide a defect
mesa=$(dpkg-query -W -f='${Version}' libgl1-mesa-dri 2>/dev/null || true)
if [ -n "$mesa" ] && dpkg --compare-versions "$mesa" ge 25; then export AMRTEX_REQUIRE_BINDLESS=1; fi
if [ $full = yes ]; then export AMRTEX_FULL=1 AMRTEX_BARE_ROOT=1; fi

results=$PWD/build/$preset/tests.xml
passed=yes
ctest --preset "$preset" --parallel "$(nproc)" --no-tests=error --output-junit "$results" "$@" || passed=no
summary=$(python3 scripts/summarize_tests.py "$results") && echo "$summary"
[ $passed = yes ] || exit 1
if [ $full = yes ]; then
  if grep -q 'Debian: ' <<<"$summary"; then echo "scripts/test.sh --full: tests were skipped for want of a package" >&2; exit 1; fi
  scripts/check_sanitizers.sh
  scripts/check_commands.sh
  scripts/check_compilers.sh
  scripts/check_mutations.py
  scripts/check_kills.py "build/$preset/amrtex"
  AMRTEX_PROGRAM=$PWD/build/$preset/amrtex scripts/gpu_check.sh --rehearse --out "build/$preset/rehearsal"
  scripts/check_comparisons.py
fi
