#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes two takes of the simulated stage, one of an actor before a blue screen and four around a volume in the stage's room, and renders
# every shot of this folder from them.
# Usage: docs/shots/make.sh [OUTPUT_FOLDER] [--width PIXELS --height PIXELS]      (default: shots-output, 320 x 240)
#   `raystage` must be on the PATH, e.g. PATH=$PWD/build/release/bin:$PATH after ./demo.sh. Takes that
#   are there already are used again.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
out="${1:-shots-output}"
shift || true
mkdir -p "$out/takes"
cp "$here"/*.json "$here"/*.chan "$here"/*.obj "$here"/surroundings.jpg "$out"
# Wide cameras that reach beyond the volume's sides (thesis, "Array layout"): 0.4 m of it, 0.44 m of them.
around="--rows 5 --columns 5 --spacing-mm 110 --fov-deg 105 --k1 0 --k2 0 --seconds 1.2"
while read -r take scene seed options; do
  if [ ! -e "$out/takes/$take/take.json" ]; then
    read -ra of_take <<<"$options"
    raystage simulate "$scene" -q -o "$out/takes/$take" --seed "$seed" "${of_take[@]}" "$@"
    raystage sync -q "$out/takes/$take" >/dev/null
  fi
done <<TAKES
stage stage 1
other stage 2
actor blue_screen 1
ahead stage 1 --position 0,0,-0.2 --rotation-deg 0 $around
left stage 1 --position -0.2,0,0 --rotation-deg 90 $around
behind stage 1 --position 0,0,0.2 --rotation-deg 180 $around
right stage 1 --position 0.2,0,0 --rotation-deg -90 $around
TAKES
for shot in "$out"/*.json; do
  name="$(basename "$shot" .json)"
  raystage render -q "$shot" -o "$out/$name/$name.####.exr" --existing skip
  raystage preview "$out/$name/$name.####.exr" --contact-sheet "$out/$name.png" \
    --frames 1,8,16,24 --columns 4 --thumbnail 320 >/dev/null
done
echo "$out: a folder and a contact sheet for each shot"
