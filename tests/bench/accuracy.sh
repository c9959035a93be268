#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Prints the PSNR of methods at every view with known truth as a Markdown table.
# Usage: tests/bench/accuracy.sh [DATA_FOLDER]
#   DATA_FOLDER (default: $RAYSTAGE_DATA or ../shared/data) holds shop/, stanford_chess9x9/,
#   stanford_knights17x17/ and stage/; missing sets are skipped. SETS="shop stage"
#   chooses sets, METHODS="plane_sweep depth" methods. Needs build/check, as ./test.sh makes it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
data="${1:-${RAYSTAGE_DATA:-../shared/data}}"
raystage="$PWD/build/check/bin/raystage"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

echo '| set | method | views | PSNR dB | SSIM | covered % | deviation dB | temporal variance of the error |'
echo '| --- | --- | --: | --: | --: | --: | --: | --: |'
for set in ${SETS:-shop stanford_chess9x9 stanford_knights17x17 stage}; do
  if [ ! -e "$data/$set/import.json" ]; then
    echo "$data/$set is missing: skipped" >&2
    continue
  fi
  take="$work/$set"
  "$raystage" import "$data/$set/import.json" -o "$take" --restart-markers >/dev/null 2>&1
  if [ "$set" = stage ]; then
    # Free-running cameras: retime every frame to the ticks of the truth.
    "$raystage" sync "$take" -q -o "${take}_moved" --fps 15 --tick-at 0.233333333 --retime flow \
      >/dev/null
    take="${take}_moved"
  fi
  for method in ${METHODS:-focal_plane plane_sweep depth}; do
    "$raystage" evaluate "$take" "$data/$set/views.json" --method "$method" \
      --no-pixel-counts --json "$work/result.json" >/dev/null 2>&1
    python3 - "$set" "$method" "$work/result.json" <<'PYTHON'
import json, sys
name, method, file = sys.argv[1:]
result = json.load(open(file))
mean, shots = result["mean"], result["shots"]
flicker = ", ".join(f'{s["id"]} {s["error_variance"]:.1f} of {s["mean_square_error"]:.1f}'
                    for s in shots)
print(f'| {name} | {method} | {len(result["views"])} | **{mean["psnr_db"]:.2f}** '
      f'| {mean["ssim"]:.4f} | {100 * mean["coverage"]:.1f} '
      f'| {result["temporal_stability"]["psnr_stddev_db"]:.2f} | {flicker} |')
PYTHON
  done
done
