#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs into an empty folder, builds examples/render_view against it alone, and compares its picture with that of
# `raystage render` for the same camera. Usage: example_test.sh BUILD_FOLDER COMPILER
set -euo pipefail
build="$(cd "$1" && pwd)"
source="$(cd "$(dirname "$0")/.." && pwd)"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
fail() { echo "FAILED: $1" >&2; exit 1; }

cmake --install "$build" --prefix "$work/prefix" >/dev/null
[ "$(ls "$work/prefix/include/raystage")" = raystage.h ] || fail "other headers than raystage.h are installed"
cmake -S "$source/examples/render_view" -B "$work/build" -G Ninja -DCMAKE_PREFIX_PATH="$work/prefix" \
  -DCMAKE_CXX_COMPILER="$2" -DCMAKE_CXX_FLAGS="-Wall -Wextra" >/dev/null
cmake --build "$work/build" >/dev/null
shown="$(nm -D --defined-only -C "$work"/prefix/lib*/libraystage.so "$work"/prefix/lib*/*/libraystage.so 2>/dev/null |
         awk '$2 ~ /[TDBVWu]/' | grep raystage:: | grep -cvE 'raystage::(LightField|make_virtual_camera|reconstruction_methods|PinholeCamera|RecordedFrame|Reconstruct|LightRay)' || true)"
[ "$shown" -eq 0 ] || fail "$shown names that are not in raystage.h are visible"

"$build/bin/raystage" simulate -o "$work/take" --rows 1 --columns 2 --seconds 1 --width 160 --height 120 \
  --truth-views 0 -q
! "$work/build/render_view" "$work/take/archive" 4 "$work/view.pfm" 2>"$work/error" || fail "no take was opened"
grep -q 'take.json' "$work/error" || fail "the error does not say what is missing: $(cat "$work/error")"
"$build/bin/raystage" sync "$work/take" -q
"$work/build/render_view" "$work/take" 4 "$work/view.pfm" | tee "$work/printed"

# Render the same view by the command: between the two cameras, along -z, at the tick in the middle.
python3 - "$work" <<'PYTHON'
import json, math, sys
work = sys.argv[1]
cameras = json.load(open(work + "/take/rig.json"))["cameras"]
x, y, z = ((cameras[0]["world_from_camera"][row][3] + cameras[1]["world_from_camera"][row][3]) / 2
           for row in range(3))
frame = next(int(line.split()[1]) for line in open(work + "/printed") if line.startswith("tick ")) + 1
json.dump({"schema": "raystage/shot/2", "width": 161, "height": 121, "fps": 15, "first_frame": 1, "last_frame": frame,
           "camera": {"keys": [{"frame": frame, "position": [x, y, z], "target": [x, y, z - 1],
                                "horizontal_fov_deg": math.degrees(0.8)}]},
           "layers": [{"name": "light_field", "take": "take", "method": "focal_plane",
                       "focal_plane": {"depth_m": 4}}]},
          open(work + "/shot.json", "w"))
PYTHON
frame="$(awk '$1 == "tick" { print $2 + 1 }' "$work/printed")"
"$build/bin/raystage" render "$work/shot.json" -o "$work/frame.####.exr" --frames "$frame" -q 2>"$work/render.log" ||
  { cat "$work/render.log"; fail "render"; }
oiiotool "$work"/frame.*.exr --ch R,G,B -d float -o "$work/rendered.exr"
idiff -q -fail 0.001 "$work/view.pfm" "$work/rendered.exr" || fail "the pictures differ"
