#!/usr/bin/env bash
# Draws the figures of README.md and docs/ again: scripts/draw_figures.sh [FIGURE ...]
set -euo pipefail
cd "$(dirname "$0")/.."
exec python3 -B scripts/draw_figures.py "$@"
