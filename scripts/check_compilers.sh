#!/usr/bin/env bash
# Builds the last commit in a bare root of Debian 13 with its compilers, GCC 14 and clang 19, warnings as errors, and runs
# the demo there. What is installed comes from scripts/setup.sh alone, so this tests it as well. Needs root and mmdebstrap;
# takes about 40 minutes on 2 cores.  usage: scripts/check_compilers.sh [FOLDER]   FOLDER: where the root is kept
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(id -u)" = 0 ] || { echo "scripts/check_compilers.sh: needs root" >&2; exit 1; }
command -v mmdebstrap >/dev/null || { echo "scripts/check_compilers.sh: mmdebstrap is missing; scripts/setup.sh --full installs it" >&2; exit 1; }

# Debian 13 from wherever Debian 12 comes from
mirror() {
  { sed -n 's/^URIs: *//p' /etc/apt/sources.list.d/*.sources; sed -nE 's/^deb (\[[^]]*\] )?([^ ]+) .*/\2/p' /etc/apt/sources.list /etc/apt/sources.list.d/*.list; } 2>/dev/null |
    grep -E '/debian/?$' | head -n 1
}
if [ $# -gt 0 ]; then root=$1; else root=$(mktemp -d); fi
unmount() { for part in dev/shm dev proc sys; do mountpoint -q "$root/$part" && umount "$root/$part"; done || true; }
clean_up() { unmount; [ $# -gt 0 ] || rm -rf "$root"; }
trap 'clean_up "$@"' EXIT

if [ ! -e "$root/etc/debian_version" ]; then
  mmdebstrap --quiet --variant=minbase --include=ca-certificates,git,clang-19 trixie "$root" "$(mirror)"
fi
mount -t proc proc "$root/proc"
mount --rbind /sys "$root/sys" && mount --make-rslave "$root/sys"
mount --bind /dev "$root/dev"
mkdir -p "$root/dev/shm" && mount -t tmpfs tmpfs "$root/dev/shm"
rm -rf "$root/amrtex" && git clone --quiet . "$root/amrtex"
inside() { chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 "$@"; }
in_tree() { inside sh -ec "cd /amrtex; $1"; }

in_tree 'scripts/setup.sh'
for compiler in g++ clang++-19; do
  in_tree "CXX=$compiler cmake --preset ci -B build/$compiler && cmake --build build/$compiler"
  in_tree "scripts/count_tests.sh build/$compiler"
  in_tree "build/$compiler/amrtex run experiments/quickstart/experiment.json --out out/$compiler"
  echo "$compiler: builds without a warning and runs the demo"
done
