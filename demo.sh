#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the main task from a fresh checkout: installs missing packages and builds. Then simulates a
# take of 64 free-running cameras, resynchronises it, and renders a moving shot that no camera
# recorded as EXR. Next to the frames it writes a preview movie, a contact sheet and a table of
# speed against accuracy.
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
cmake --build "$build" -j "$(nproc)"
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

say "render the shot"
"$raystage" render "$take/shot.json" -o "$out/frames/shot.####.exr" --existing skip

say "preview"
"$raystage" preview "$out/frames/shot.####.exr" -o "$out/preview.mp4" \
  --contact-sheet "$out/contact-sheet.png"

say "speed against accuracy, against the simulation's truth"
table="$out/speed-accuracy.md"
rm -f "$table"
measure() {  # LABEL OPTION...
  local label="$1"
  shift
  "$raystage" evaluate "$take" "$take/views.json" --method focal_plane --table "$table" \
    --label "$label" "$@" >/dev/null
}
measure "8x8 cameras, plane at 5 m, as the shot" --focal-depth 5 --out "$out/evaluated" \
  --json "$out/evaluation.json"
measure "the same on one thread" --focal-depth 5 --threads 1
measure "the same, blended in linear light" --focal-depth 5 --blend linear
measure "4x4 cameras, plane at 5 m" --focal-depth 5 --camera-step 2
measure "8x8 cameras, plane at 3 m" --focal-depth 3
measure "8x8 cameras, plane at 7.5 m" --focal-depth 7.5
measure "8x8 cameras, eq. 2.2's plane" --focal-depth best
cat "$table"

say "done; look at"
for result in preview.mp4 contact-sheet.png speed-accuracy.md frames evaluated take; do
  echo "  $(cd "$out" && pwd)/$result"
done
