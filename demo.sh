#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the main task from a fresh checkout: installs missing packages and builds the commands that it
# needs. Then simulates a take of 64 free-running cameras, resynchronises it, and renders two shots
# that no camera recorded as EXR: docs/shots/demo.json, in which time stops and a ball is added, and
# a focus pull. Next to the frames it writes movies, contact sheets and a table of speed against
# accuracy.
# Usage: ./demo.sh [OUTPUT_FOLDER]      (default: demo-output; a second run reuses existing files)
set -euo pipefail
cd "$(dirname "$0")"
out="${1:-demo-output}"
build=build/release
say() { printf '\n== %s (%ss since start)\n' "$1" "$SECONDS"; }

if [ -z "${RAYSTAGE_SKIP_INSTALL:-}" ]; then
  say "Debian packages"
  scripts/install_packages.sh build run
fi

say "Release build"
mkdir -p build "$out"
if ! cmake --preset release -DRAYSTAGE_TESTS=OFF >build/release.configure.log 2>&1; then
  cat build/release.configure.log
  exit 1
fi
commands=(simulate sync info render preview evaluate)
cmake --build "$build" -j "$(nproc)" --target raystage "${commands[@]/#/raystage-}"
raystage="$build/bin/raystage"

take="$out/take"
if [ -e "$take/take.json" ]; then
  say "the take is there already: $take"
else
  say "simulate: 8x8 cameras, 60 mm apart, 62 degrees, 15 fps, free running"
  "$raystage" simulate -o "$take"
fi

say "resynchronise"
"$raystage" sync "$take"
"$raystage" info "$take"

mkdir -p "$out/shots"
cp docs/shots/ball.obj "$out/shots"
for name in demo focus_pull; do
  sed 's#"takes/stage"#"../take"#' "docs/shots/$name.json" >"$out/shots/$name.json"
  say "render $name"
  "$raystage" render "$out/shots/$name.json" -o "$out/frames/$name.####.exr" --existing skip
  "$raystage" preview "$out/frames/$name.####.exr" -o "$out/$name.mp4" \
    --contact-sheet "$out/$name.png"
done

say "speed against accuracy, against the simulation's truth"
table="$out/speed-accuracy.md"
rm -f "$table"
measure() {  # METHOD LABEL OPTION...
  local method="$1" label="$2"
  shift 2
  "$raystage" evaluate "$take" "$take/views.json" --method "$method" --table "$table" \
    --label "$label" "$@" >/dev/null
}
measure focal_plane "focal_plane, 5 m" --focal-depth 5
measure focal_plane "the same on one thread" --focal-depth 5 --threads 1
measure focal_plane "the same, blended in linear light" --focal-depth 5 --blend linear
measure focal_plane "the same, 4x4 cameras" --focal-depth 5 --camera-step 2
measure focal_plane "focal_plane, 3 m" --focal-depth 3
measure focal_plane "focal_plane, eq. 2.2's plane" --focal-depth best
measure plane_sweep "plane_sweep, as shots without a method" --out "$out/evaluated" \
  --json "$out/evaluation.json"
cat "$table"

say "done; look at"
for result in demo.mp4 demo.png focus_pull.mp4 focus_pull.png speed-accuracy.md frames evaluated take; do
  echo "  $(cd "$out" && pwd)/$result"
done
echo "The other commands: cmake --build $build"
