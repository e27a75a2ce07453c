#!/usr/bin/env bash
# Installs what amrtex needs from the distribution's packages, and nothing else; with --full also what only some checks
# need, without which tests skip themselves and say so.
# Debian 12: Mesa comes from bookworm-backports, because 22.3 has no bindless
# textures and marches 1.2-1.5 times slower; Debian 13 and Ubuntu 24.04 have a
# new enough Mesa as stock. Runs as root or with sudo; does nothing when all is there.
set -euo pipefail

packages=(g++ cmake ninja-build pkg-config python3 python3-glad
          libegl-dev libgl-dev libglm-dev libtbb-dev nlohmann-json3-dev libfmt-dev libspdlog-dev
          libtinyobjloader-dev libcli11-dev libpng-dev libopenexr-dev libcairo2-dev libfreetype-dev fonts-dejavu-core libpugixml-dev zlib1g-dev libzip-dev libhdf5-dev libxxhash-dev libgtest-dev
          libgmock-dev libbenchmark-dev librapidcheck-dev patchelf
          pybind11-dev python3-dev python3-numpy python3-pytest python3-matplotlib)
# a browser, LaTeX, a second reader of what we write, engines of clusters, a bare root of another distribution
optional=(chromium texlive-latex-recommended texlive-latex-extra python3-h5py python3-yt paraview python3-paraview
          snakemake slurm-wlm python3-pandas mmdebstrap)
# plots of report pages; pictures of them where there is no npm
modules=(vega@6.4.0 vega-lite@6.5.0 vega-embed@7.3.0)
case ${1:-} in
  '') ;;
  --full) packages+=("${optional[@]}"); command -v npm >/dev/null || packages+=(npm) ;;
  *) echo "scripts/setup.sh: no argument '$1'; accepted: --full" >&2; exit 2 ;;
esac
mesa=(libgl1-mesa-dri libegl-mesa0 libglx-mesa0 mesa-vulkan-drivers libvulkan1 libgbm1)
# Mesa 25.1 dropped OSMesa; where a distribution has no package, the EGL path alone remains.
osmesa=libosmesa6

run_as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
installed() { dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q '^install ok installed$'; }
mesa_version() { dpkg-query -W -f='${Version}' libgl1-mesa-dri 2>/dev/null || true; }
install_quietly() {
  run_as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -q --no-install-recommends -o Dpkg::Use-Pty=0 "$@" >"$log" 2>&1 ||
    { tail -n 40 "$log" >&2; echo "setup: installing failed: $*" >&2; exit 1; }
}

. /etc/os-release
log=$(mktemp)
root=$(cd "$(dirname "$0")/.." && pwd)

# Their bundles alone, of these very versions: what they depend on is inside of them.
install_modules() {
  local module name folder
  command -v npm >/dev/null || { echo "setup: no npm here; the plots of report pages will be pictures" >&2; return 0; }
  for module in "${modules[@]}"; do
    name=${module%@*}
    folder=$root/node_modules/$name
    grep -qs "\"version\": \"${module#*@}\"" "$folder/package.json" && continue
    rm -rf "$folder" "$folder.new"
    mkdir -p "$folder.new"
    if ! (cd "$folder.new" && npm pack --silent "$module" >package.name && tar -xzf "$(tail -n 1 package.name)" --strip-components=1) 2>"$log"; then
      rm -rf "$folder.new"
      echo "setup: the npm package $module cannot be had; the plots of report pages will be pictures: $(tail -n 1 "$log")" >&2
      return 0
    fi
    rm -f "$folder.new"/*.tgz "$folder.new/package.name"
    mv "$folder.new" "$folder"
  done
}
trap 'rm -f "$log"' EXIT

# The backports suite, derived from whichever source serves bookworm already.
add_backports() {
  local target=/etc/apt/sources.list.d/amrtex-backports.sources file
  grep -rqsE '(Suites:|^deb ).*bookworm-backports' /etc/apt/sources.list /etc/apt/sources.list.d && return 0
  for file in /etc/apt/sources.list.d/*.sources; do
    [ -e "$file" ] || continue
    # the first stanza that names plain "bookworm", with its suites replaced
    awk 'BEGIN { RS = ""; FS = "\n" } /(^|\n)Suites:[^\n]*(^|[ \t])bookworm([ \t\n]|$)/ { print; exit }' "$file" |
      sed -E '/^#/d; s/^Suites:.*/Suites: bookworm-backports/' >"$log"
    if [ -s "$log" ]; then run_as_root cp "$log" "$target"; run_as_root chmod 644 "$target"; return 0; fi
  done
  local line
  line=$(grep -hE '^deb .* bookworm ' /etc/apt/sources.list /etc/apt/sources.list.d/*.list 2>/dev/null | head -n 1) || true
  [ -n "$line" ] || { echo "setup: no configured source for bookworm to derive bookworm-backports from" >&2; exit 1; }
  printf '%s\n' "${line/ bookworm / bookworm-backports }" | run_as_root tee /etc/apt/sources.list.d/amrtex-backports.list >/dev/null
}

missing=()
for package in "${packages[@]}" "${mesa[@]}"; do installed "$package" || missing+=("$package"); done
backport_mesa=no
if [ "${VERSION_CODENAME:-}" = bookworm ] && { [ -z "$(mesa_version)" ] || dpkg --compare-versions "$(mesa_version)" lt 25; }; then
  backport_mesa=yes
fi
if [ ${#missing[@]} = 0 ] && [ $backport_mesa = no ] && { installed $osmesa || [ -e /var/lib/amrtex-no-osmesa ]; }; then
  install_modules
  exit 0
fi

echo "setup: installing packages" >&2
[ $backport_mesa = yes ] && add_backports
run_as_root apt-get update -q >"$log" 2>&1 || { tail -n 20 "$log" >&2; echo "setup: apt-get update failed" >&2; exit 1; }
if [ $backport_mesa = yes ]; then
  install_quietly -t bookworm-backports "${mesa[@]}" $osmesa
fi
install_quietly "${packages[@]}" "${mesa[@]}"
if ! installed $osmesa; then
  if apt-cache show $osmesa >/dev/null 2>&1; then install_quietly $osmesa
  else echo "setup: this distribution has no $osmesa; OSMesa contexts will be reported as unavailable" >&2; run_as_root touch /var/lib/amrtex-no-osmesa; fi
fi
install_modules
