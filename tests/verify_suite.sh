#!/bin/sh
# One suite of `amrtex verify`: a quarter of its questions, of each some, or all with AMRTEX_FULL=1.
set -eu
program=$1
suite=$2
if [ "${AMRTEX_FULL:-}" = 1 ]; then set --; else set -- --one-in 4; fi
exec "$program" verify --suite "$suite" "$@"
