#!/usr/bin/env bash
# What is true on this GPU? Pictures against references, limits, times: experiments/gpu/README.md.
#
#   scripts/gpu_check.sh [--minutes 8] [--out DIR] [--device N] [--rehearse]
#
# Writes below DIR alone (amrtex_gpu_check), needs no network and no root. Exit code 0: all parts that had time passed; 1: one
# failed; 2: it could not begin. --rehearse draws small pictures by the software rasterisers of this machine instead.
set -uo pipefail

usage() { sed -n '2,7s/^# \{0,1\}//p' "$0"; }
refuse() { echo "gpu_check: $1" >&2; exit 2; }

minutes=8 out=amrtex_gpu_check device='' rehearse=no
while [ $# -gt 0 ]; do
  case $1 in
    --minutes | --out | --device)
      [ $# -gt 1 ] || refuse "$1: a value is expected"
      case $1 in --minutes) minutes=$2 ;; --out) out=$2 ;; --device) device=$2 ;; esac
      shift 2 ;;
    --rehearse) rehearse=yes; shift ;;
    --help | -h) usage; exit 0 ;;
    *) refuse "no argument '$1'; accepted: --minutes N, --out DIR, --device N, --rehearse" ;;
  esac
done
[[ $minutes =~ ^[1-9][0-9]{0,3}$ ]] || refuse "--minutes $minutes: accepted: a whole number from 1 to 9999"
[[ $device =~ ^[0-9]{0,3}$ ]] || refuse "--device $device: accepted: a number that amrtex doctor lists"

here=$(cd "$(dirname "$(readlink -f "$0")")" && pwd)
root=$(dirname "$here")
amrtex=${AMRTEX_PROGRAM:-}
for place in "$root/../../bin/amrtex" "$root/build/release/amrtex" "$root/build/ci/amrtex"; do
  [ -z "$amrtex" ] && [ -x "$place" ] && amrtex=$(readlink -f "$place")
done
[ -x "$amrtex" ] || refuse "no program: looked in bin/ of the bundle and in build/release; build it, or name it in AMRTEX_PROGRAM"
experiments=$root/experiments
if ! mkdir -p "$out" 2>/dev/null || ! : 2>/dev/null >"$out/summary.txt"; then
  refuse "$out: no folder that can be written; choose another with --out"
fi
out=$(cd "$out" && pwd)
free_kib=$(df -Pk "$out" | awk 'NR == 2 {print $4}')
[ "$free_kib" -ge $((2 * 1024 * 1024)) ] || refuse "$out: $((free_kib / 1024)) MiB are free, 2048 are needed"

# whatever is kept, it is kept there
export TMPDIR=$out/tmp XDG_CACHE_HOME=$out/cache MESA_SHADER_CACHE_DIR=$out/cache __GL_SHADER_DISK_CACHE_PATH=$out/cache
mkdir -p "$TMPDIR" "$XDG_CACHE_HOME"
failures=0 passed=0 cut=0 left=0

say() { printf '%s\n' "$*" | tee -a "$out/summary.txt"; }
seconds_left() { echo $((deadline - SECONDS)); }

# within SECONDS COMMAND...: 124 where time was up; the command may be a function of this script.
within() {
  local limit=$1 worker watch code
  shift
  set -m # groups of their own, which end as a whole
  "$@" &
  worker=$!
  (sleep "$limit"; kill -TERM -- "-$worker"; sleep 5; kill -KILL -- "-$worker") 2>/dev/null &
  watch=$!
  set +m
  wait "$worker"
  code=$?
  kill -TERM -- "-$watch" 2>/dev/null
  wait "$watch" 2>/dev/null
  case $code in 137 | 143) code=124 ;; esac # other signals are crashes
  return "$code"
}

# part NAME SECONDS WHAT COMMAND...: runs it for so long at most, in proportion to --minutes, and goes on whatever became of it.
part() {
  local name=$1 share=$2 what=$3 begin=$SECONDS limit code
  shift 3
  limit=$((share * minutes / 8))
  [ "$limit" -lt 10 ] && limit=10
  [ "$limit" -gt "$(seconds_left)" ] && limit=$(seconds_left)
  if [ "$limit" -lt 3 ]; then left=$((left + 1)); say "  not begun  $name: no time was left ($what)"; return; fi
  part_limit=$limit part_folder=$folder/$name
  within "$limit" "$@" >"$folder/$name.log" 2>&1 </dev/null
  code=$?
  case $code in
    0) passed=$((passed + 1))
       say "$(printf '  ok         %-14s %4d s  %s' "$name" $((SECONDS - begin)) "$what")" ;;
    124) cut=$((cut + 1))
       say "$(printf '  cut        %-14s %4d s  %s (records so far are kept)' "$name" $((SECONDS - begin)) "$what")" ;;
    *) failures=$((failures + 1))
       say "$(printf '  FAILED     %-14s %4d s  %s: %s' "$name" $((SECONDS - begin)) "$what" \
         "$(tail -n 1 "$folder/$name.log" | cut -c1-160)")" ;;
  esac
}

# run_experiment NAME FILE ARGUMENTS...: records go to the folder of the part
run_experiment() {
  local file=$1; shift
  "$amrtex" run "$file" --out "$part_folder" "${context[@]}" --no-pictures --time-limit $((part_limit > 8 ? part_limit - 5 : 3)) "$@"
}

doctor() {
  "$amrtex" doctor && "$amrtex" doctor --json >"$folder/doctor.json"
}

conformance() {
  mkdir -p "$part_folder/references"
  cp "$experiments"/gpu/references/* "$part_folder/references/" # the pictures that came with the program are the judges
  run_experiment "$experiments/gpu/conformance.json"
}

# pictures of one filter on the lattice have one hash
one_picture() {
  local hashes
  run_experiment "$@" || return 1
  hashes=$(grep -o '"image_hash":"[0-9a-f]*"' "$part_folder/records.jsonl" | sort | uniq -c)
  echo "$hashes"
  [ "$(printf '%s\n' "$hashes" | grep -c image_hash)" = 1 ] || { echo "pictures differ to the bit: ${hashes//$'\n'/,}"; return 1; }
}

points() {
  printf '0.1 0.2 0.3\n0.5 0.5 0.5\n0.77 0.31 0.9\n0 0 0\n1 1 1\n' >"$folder/points.txt"
  for pair in 'uniform nearest' 'page_table linear_page' 'octree linear_lod' 'kd_tree linear_vertex' 'exabricks basis'; do
    "$amrtex" sample "$root/data/amrex_tiny/plt00008" --encoding "${pair% *}" --filter "${pair#* }" --points "$folder/points.txt" \
      "${context[@]}" --json || return 1
  done
}

limits() {
  local code=0
  for file in experiment octree kd_tree exabricks dense; do
    run_experiment "$experiments/limits/$file.json" --set reference=null --set frames=5 "${smaller[@]}" || code=1
  done
  return $code
}

paper() { run_experiment "$experiments/$1/experiment.json" --where "$2" --set reference=null --set frames=5 "${small[@]}"; }

# check NAME: all parts on one context
check() {
  folder=$out/$1
  turn=$((turn + 1))
  deadline=$((60 * minutes * turn / contexts)) # a context that ends early leaves its time to the next
  mkdir -p "$folder"
  say "$1 (${context[*]})"
  part doctor 30 'what the drivers say' doctor
  part points 30 'five points: reference, double, GL' points
  part conformance 60 'each encoding and filter against the reference pictures of the bundle' conformance
  part bits 30 'nearest: one picture to the bit, by fragments and compute' one_picture "$experiments/gpu/bits.json"
  part bindless 20 'textures by handles give the picture of the pool' one_picture "$experiments/gpu/bindless.json"
  part stiff 40 'verify: stiff media' "$amrtex" verify --suite stiff "${context[@]}" "${few[@]}" --out "$folder/stiff"
  part extreme 40 'verify: extremes' "$amrtex" verify --suite extreme "${context[@]}" "${few[@]}" --out "$folder/extreme"
  part limits 60 'limits, all encodings' limits
  part page_sizes 40 'page sizes' run_experiment "$experiments/page_sizes/experiment.json" --set reference=null "${small[@]}" "${tiny[@]}"
  part pixels 30 'time against pixels' run_experiment "$experiments/gpu/pixels.json" "${pixels[@]}"
  part dispatch 20 'fragment and compute' run_experiment "$experiments/gpu/dispatch.json" "${small[@]}"
  part vollrath 20 'a row of Vollrath 2006' paper vollrath_2006 'dataset = "Audi-like" and mode = dvr'
  part kaehler_abel 20 'a row of Kaehler and Abel 2013' paper kaehler_abel_2013 'dataset = small'
  part exabricks 20 'a row of ExaBricks 2020' paper exabricks_2020 'dataset = "Impact-like"'
  part slices 20 'a row of Kaehler and Hege 2002' paper kaehler_hege_2002 'dataset = "I-like"'
  for records in "$folder"/*/records.jsonl; do
    [ -e "$records" ] && "$amrtex" report "$(dirname "$records")" >/dev/null 2>&1
  done
}

say "amrtex GPU check, $(date -u +%Y-%m-%dT%H:%M:%SZ), $minutes minutes at most, $("$amrtex" --version)"
few=() small=() smaller=() tiny=() pixels=() contexts=1 turn=0
if [ "$rehearse" = yes ]; then
  say 'REHEARSAL on software rasterisers: small sizes; no time here says anything of a GPU'
  few=(--one-in 40)
  small=(--set width=64 --set height=64 --set frames=1)
  smaller=("${small[@]}" --set 'datasets={"name": "blobs_shell 128", "generate": {"field": "blobs_shell", "levels": 2}}'
           --where 'sampling = adaptive and filter != nearest')
  tiny=(--where 'dataset = amrex_tiny')
  pixels=(--where 'width <= 256')
  contexts=3
  context=(--context egl); LIBGL_ALWAYS_SOFTWARE=1 check llvmpipe
  context=(--context egl); LIBGL_ALWAYS_SOFTWARE=1 MESA_LOADER_DRIVER_OVERRIDE=zink check zink
  context=(--context osmesa); check osmesa
else
  context=(--context egl_device)
  [ -n "$device" ] && context+=(--device "$device")
  check gpu
fi
rm -rf "$TMPDIR" "$XDG_CACHE_HOME"
say "$passed parts passed, $failures failed, $cut were cut by their time, $left not begun; records, logs and this page are in $out ($(du -sm "$out" | cut -f1) MiB)"
[ "$failures" = 0 ]
