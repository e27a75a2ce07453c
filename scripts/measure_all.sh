#!/usr/bin/env bash
# Measures every committed experiment again and writes its results: a table, and the records, compressed. Takes hours; a run that was interrupted
# goes on where it stopped.
#   scripts/measure_all.sh                 all experiments
#   scripts/measure_all.sh limits scale    some
# AMRTEX_PROGRAM names the program (build/release/amrtex), AMRTEX_OUT the folder of what is measured (out/measure_all).
set -euo pipefail
cd "$(dirname "$0")/.."
program=${AMRTEX_PROGRAM:-build/release/amrtex}
out=${AMRTEX_OUT:-out/measure_all}
[ -x "$program" ] || { echo "scripts/measure_all.sh: $program is missing; cmake --build --preset release makes it" >&2; exit 1; }
if [ $# -eq 0 ]; then set -- $(ls experiments); fi

failed=
for name in "$@"; do
  [ -d "experiments/$name" ] || { echo "scripts/measure_all.sh: no experiment '$name'; accepted: $(ls experiments | tr '\n' ' ')" >&2; exit 2; }
  # a file of several in one folder has its own folder of results, called like the file
  for file in "experiments/$name"/*.json "experiments/$name"/checked/*.json; do
    [ -e "$file" ] || continue
    case $(basename "$file") in tables.json|columns.json|scene*.json) continue ;; esac
    part=$(basename "$file" .json)
    folder=$(dirname "$file")/results
    [ "$part" = experiment ] || folder=$folder/$part
    target=$out/${folder#experiments/}
    echo "== $file"
    mkdir -p "$target"
    "$program" run "$file" --out "$target" >"$target.log" 2>&1 || { echo "   ended with $?, see $target.log"; failed="$failed $file"; continue; }
    mkdir -p "$folder"
    cp "$target/table.md" "$folder/table.md"
    for diagram in "$target"/*.vl.json; do [ -e "$diagram" ] && cp "$diagram" "$folder/"; done
    gzip -9 -n <"$target/records.jsonl" >"$folder/records.jsonl.gz"
  done
done
[ -z "$failed" ] || { echo "scripts/measure_all.sh: not measured:$failed" >&2; exit 1; }
