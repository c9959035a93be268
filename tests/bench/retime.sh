#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures the gain of retiming in views with known truth, and its time: the tables of docs/resync.md.
# Usage: tests/bench/retime.sh [DATA_FOLDER]   (default: $RAYSTAGE_DATA or ../shared/data; without
# its stage/ only the simulated take is measured). Needs build/check, as ./test.sh makes it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
data="${1:-${RAYSTAGE_DATA:-../shared/data}}"
raystage="$PWD/build/check/bin/raystage"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

row() {  # NAME TAKE VIEWS FOCAL_DEPTH [SYNC OPTION...]
  local name="$1" take="$2" views="$3" depth="$4" moved said
  shift 4
  moved="$work/moved"
  rm -rf "$moved"
  said="$("$raystage" sync "$take" -q -o "$moved" "$@")"
  "$raystage" evaluate "$moved" "$views" --focal-depth "$depth" 2>/dev/null |
    awk -v name="$name" -v ms="$(awk '/^Cost/ { print $2 }' <<<"$said")" \
        -v missing="$(awk '/^Retimed/ { print $(NF - 1) }' <<<"$said")" \
        '$1 == "mean" { printf "| %s | %s | %s | %s | %s |\n", name, $2, $3, ms == "" ? "0" : ms, missing }'
}
table() {  # NAME TAKE VIEWS FOCAL_DEPTH TICK_AT
  printf '\n%s\n| | PSNR dB | SSIM | ms per moved frame | frames missing |\n| --- | --: | --: | --: | --: |\n' "$1"
  for method in nearest blend flow; do
    row "$method" "$2" "$3" "$4" --fps 15 --tick-at "$5" --retime "$method"
  done
  row "flow, lost frames not bridged" "$2" "$3" "$4" --fps 15 --tick-at "$5" --retime flow --max-gap 80
}

if [ -e "$data/stage/import.json" ]; then
  "$raystage" import "$data/stage/import.json" -o "$work/stage" --restart-markers >/dev/null 2>&1
  table "stage, 64 cameras 480x360, 20 views" "$work/stage" "$data/stage/views.json" best 0.233333333
else
  echo "$data/stage is missing: skipped" >&2
fi
"$raystage" simulate stage -o "$work/long" -q --seed 7 --seconds 10 --drop 0.03 --clock-offset-ms 0 \
  --truth-views 24 >/dev/null
at="$(python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["views"][0]["time_ns"] / 1e9)' "$work/long/views.json")"
table "simulated stage, 10 s, 3 % of frames lost, 24 views" "$work/long" "$work/long/views.json" 5 "$at"
"$raystage" simulate stage -o "$work/near" -q --seed 7 --seconds 10 --drop 0.03 --clock-offset-ms 0 \
  --truth-views 24 --spacing-mm 10 >/dev/null
table "the same with cameras 10 mm apart" "$work/near" "$work/near/views.json" 5 "$at"
