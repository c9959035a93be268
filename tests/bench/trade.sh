#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures speed against accuracy of every method: the tables of docs/benchmarks.md.
# Usage: tests/bench/trade.sh [DATA_FOLDER] [BENCH_OPTION...]
#   DATA_FOLDER (default: $RAYSTAGE_DATA or ../shared/data) holds shop/, stanford_chess9x9/,
#   stanford_knights17x17/ and stage/; missing sets are skipped. Options are passed to every
#   `raystage bench`, e.g. --view-step 8 to try, or --settings FILE. SETS="shop planes simulated" chooses
#   sets, PAGES=DIR keeps the pages, CSV and JSON. Needs build/check, as ./test.sh makes it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
data="${RAYSTAGE_DATA:-../shared/data}"
if [ $# -gt 0 ] && [ "${1#-}" = "$1" ]; then
  data="$1"
  shift
fi
raystage="$PWD/build/check/bin/raystage"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
pages="${PAGES:-$work/pages}"

wanted() {
  [[ " ${SETS:-shop planes stanford_chess9x9 stanford_knights17x17 stage simulated} " == *" $1 "* ]]
}
measure() {  # NAME HEADING TAKE VIEWS [BENCH_OPTION...]
  local name="$1" heading="$2" take="$3" views="$4"
  shift 4
  printf '\n**%s**\n\n' "$heading"
  "$raystage" bench "$take" "$views" -o "$pages/$name" -q "$@"
}
import() {  # SET: into $work/SET; reports a missing set
  if [ ! -e "$data/$1/import.json" ]; then
    echo "$data/$1 is missing: skipped" >&2
    return 1
  fi
  "$raystage" import "$data/$1/import.json" -o "$work/$1" --restart-markers >/dev/null 2>&1
}

if wanted shop && import shop; then
  measure shop "shop, 64 cameras 960x640" "$work/shop" "$data/shop/views.json" "$@"
fi
if wanted planes && { [ -e "$work/shop" ] || import shop; }; then
  settings=()
  for planes in 4 8 16 32 48 64 96 128 192 256; do
    settings+=(--setting "$planes planes:plane_sweep:planes=$planes")
  done
  measure planes "shop, error against the number of planes" "$work/shop" "$data/shop/views.json" \
    "${settings[@]}" "$@"
fi
if wanted stanford_chess9x9 && import stanford_chess9x9; then
  measure chess "stanford_chess9x9, 25 cameras 848x480" "$work/stanford_chess9x9" \
    "$data/stanford_chess9x9/views.json" "$@"
fi
if wanted stanford_knights17x17 && import stanford_knights17x17; then
  measure knights "stanford_knights17x17, 81 cameras 256x256, then every 2nd and 4th row and column" \
    "$work/stanford_knights17x17" "$data/stanford_knights17x17/views.json" --camera-step 1,2,4 "$@"
  printf '\n| cameras | spacing mm | disparity px | planes by eq. 2.1 |\n| --: | --: | --: | --: |\n'
  python3 - "$pages/knights/trade.json" <<'PYTHON'
import json, sys
seen = set()
for row in json.load(open(sys.argv[1]))["rows"]:
    if row["failure"] is None and row["cameras"] not in seen:
        seen.add(row["cameras"])
        print(f'| {row["cameras"]:.0f} | {1e3 * row["spacing_m"]:.4g} | {row["disparity_px"]:.2f} '
              f'| {row["planes_needed"]:.0f} |')
PYTHON
fi
if wanted stage && import stage; then
  # Free-running cameras: retime every frame to the ticks of the truth.
  "$raystage" sync "$work/stage" -q -o "$work/stage_moved" --fps 15 --tick-at 0.233333333 \
    --retime flow >/dev/null
  measure stage "stage, 64 cameras 480x360, frames moved to their ticks" "$work/stage_moved" \
    "$data/stage/views.json" "$@"
fi
if wanted simulated; then
  "$raystage" simulate -o "$work/simulated" -q --seed 7 --seconds 2 --jitter-ms 0 \
    --period-ppm 0 --startup-loss-seconds 0 --clock-offset-ms 0 --truth-views 24 >/dev/null
  at="$(python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["views"][0]["time_ns"] / 1e9)' \
    "$work/simulated/views.json")"
  "$raystage" sync "$work/simulated" -q -o "$work/simulated_moved" --fps 15 --tick-at "$at" \
    --retime flow >/dev/null
  measure simulated "simulated stage, 64 cameras 320x240, 24 views" "$work/simulated_moved" \
    "$work/simulated/views.json" "$@"
fi
