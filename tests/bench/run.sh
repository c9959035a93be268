#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds and runs the benchmarks that docs/benchmarks.md quotes.
# Usage: tests/bench/run.sh [DATA_FOLDER]    (default: $RAYSTAGE_DATA or ../shared/data beside the
# checkout; without its shop/ light field a painted plane stands in)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
data="${1:-${RAYSTAGE_DATA:-../shared/data}}"
build=build/check
cmake --preset check >/dev/null
cmake --build "$build" -j "$(nproc)" >/dev/null
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
if [ -e "$data/shop/import.json" ]; then
  for variant in restart plain; do
    options=()
    [ "$variant" = plain ] || options=(--restart-markers)
    "$build/bin/raystage" import "$data/shop/import.json" -o "$work/$variant" "${options[@]}" \
      >/dev/null 2>&1
  done
  export RAYSTAGE_BENCH_TAKE="$work/restart" RAYSTAGE_BENCH_TAKE_PLAIN="$work/plain"
else
  echo "no $data/shop: the benchmark runs on a painted plane" >&2
fi
"$build/bin/focal_plane_bench"
"$build/bin/jpeg_bench"
