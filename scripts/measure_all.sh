#!/usr/bin/env bash
# Measures every committed experiment again and writes its results: a table, the records, compressed, and small pictures. Takes hours; a run that was interrupted
# goes on where it stopped.
#   scripts/measure_all.sh                          all experiments
#   scripts/measure_all.sh scale limits/octree.json  some, or a file of one
# AMRTEX_PROGRAM names the program (build/release/amrtex), AMRTEX_OUT the folder of what is measured (out/measure_all); AMRTEX_GPU=1 says that
# the default driver has bindless textures.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${AMRTEX_PROGRAM:-build/release/amrtex}
out=${AMRTEX_OUT:-out/measure_all}
[ -x "$program" ] || { echo "scripts/measure_all.sh: $program is missing; cmake --build --preset release makes it" >&2; exit 1; }
if [ $# -eq 0 ]; then set -- $(ls experiments | grep -v '^gpu$'); fi  # those of gpu are measured by gpu_check.sh

# The experiment files of an argument. A plate is one picture of a README, no measurement.
files_of() {
  case $1 in *.json) ls "experiments/$1"; return ;; esac
  for file in "experiments/$1"/*.json "experiments/$1"/*/experiment.json; do
    case $(basename "$file") in tables.json|columns.json|scene*.json|plate_*.json) continue ;; esac
    [ ! -e "$file" ] || echo "$file"
  done
}

# A file that is not called experiment.json has a folder of results of its own.
results_of() {
  local part
  part=$(basename "$1" .json)
  if [ "$part" = experiment ]; then echo "$(dirname "$1")/results"; else echo "$(dirname "$1")/results/$part"; fi
}

# Textures by handle need a driver that has them; without a GPU that is Mesa's zink.
environment_of() {
  case $1 in */bindless/*) [ -n "${AMRTEX_GPU:-}" ] || echo "LIBGL_ALWAYS_SOFTWARE=1 MESA_LOADER_DRIVER_OVERRIDE=zink" ;; esac
}

failed=
measure() {
  local folder target
  folder=$(results_of "$1")
  target=$out/${folder#experiments/}
  echo "== $1"
  mkdir -p "$target"
  env $(environment_of "$1") "$program" run "$1" --out "$target" >"$target.log" 2>&1 || { echo "   ended with $?, see $target.log"; failed="$failed $1"; return 0; }
  mkdir -p "$folder"
  cp "$target/table.md" "$folder/table.md"
  for diagram in "$target"/*.vl.json; do [ ! -e "$diagram" ] || cp "$diagram" "$folder/"; done
  gzip -9 -n <"$target/records.jsonl" >"$folder/records.jsonl.gz"
  # small ones of those that a page shows
  "$program" report "$target" --keep-pictures >>"$target.log" 2>&1
  [ ! -e "$target/pictures.npz" ] || cp "$target/pictures.npz" "$folder/"
}

for name in "$@"; do
  [ -e "experiments/$name" ] || { echo "scripts/measure_all.sh: no experiment '$name'; accepted: $(ls experiments | tr '\n' ' ')" >&2; exit 2; }
done
for name in "$@"; do
  for file in $(files_of "$name"); do measure "$file"; done
done
[ -z "$failed" ] || { echo "scripts/measure_all.sh: not measured:$failed" >&2; exit 1; }
