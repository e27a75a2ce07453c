#!/usr/bin/env bash
# Installs what is missing, builds the program, runs the experiment quickstart on the sample data,
# prints the result table and where the pictures are.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
cmake --preset release
cmake --build --preset release --target amrtex
build/release/amrtex run experiments/quickstart/experiment.json --out out/quickstart
echo "pictures:"
ls out/quickstart/pictures/*.png
