#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures the time of a composited frame of 1920x1080: a light field (focal_plane, 64 cameras of
# 960x640), a mesh of a million triangles, both, and a picture of one colour (only writing). Each is
# rendered with all AOVs, and with picture and depth only; several frames in parallel, and one by
# one. Both are also rendered to a disk that needs 0.7 of a frame's time per file.
# Usage: tests/bench/compose.sh [FOLDER] [FRAMES] [BAD_DISK_LIBRARY]     (default: a temporary folder, 8, none)
#   `raystage` must be on the PATH, e.g. PATH=$PWD/build/check/bin:$PATH. The library that slows down
#   the disk belongs to the tests: build/check/tests/end_to_end/libbad_disk.so.
set -euo pipefail
folder="${1:-$(mktemp -d)}"
frames="${2:-8}"
mkdir -p "$folder"
cd "$folder"
if [ ! -e take/timeline.zst ]; then
  raystage simulate still -q -o take --width 960 --height 640 --seconds 0.2 --startup-loss-seconds 0 \
    --drop 0 --truth-views 0
  raystage sync -q take >/dev/null
fi
if [ ! -e ball.ply ]; then
  awk 'BEGIN {
    n = 500; m = 1000; pi = 3.14159265358979
    printf "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n", (n + 1) * m
    printf "element face %d\nproperty list uchar int vertex_indices\nend_header\n", 2 * n * m
    for (i = 0; i <= n; ++i) for (j = 0; j < m; ++j) {
      p = pi * i / n; t = 2 * pi * j / m; r = 1 + 0.03 * sin(9 * p) * sin(11 * t)
      printf "%.6f %.6f %.6f\n", r * sin(p) * cos(t), r * cos(p), r * sin(p) * sin(t)
    }
    for (i = 0; i < n; ++i) for (j = 0; j < m; ++j) {
      a = i * m + j; b = i * m + (j + 1) % m
      printf "3 %d %d %d\n3 %d %d %d\n", a, b, a + m, b, b + m, a + m
    }
  }' >ball.ply
fi

light_field='{"name": "set", "take": "take", "focal_plane": {"depth_m": 4.5}, "speed": 0}'
mesh='{"name": "ball", "geometry": {"file": "ball.ply", "material": {"kind": "diffuse", "color": [0.7, 0.6, 0.5]},
  "keys": [{"frame": 1, "position": [0, 0, -3], "scale": 0.8}], "samples": 4}}'
solid='{"name": "grey", "solid": {"color": [0.2, 0.3, 0.4]}}'
shot() {  # NAME LAYERS [AOVS]
  cat >"$1.json" <<SHOT
{"schema": "raystage/shot/2", "width": 1920, "height": 1080, "fps": 24, "first_frame": 1, "last_frame": $frames,
 "camera": {"keys": [{"frame": 1, "position": [-0.1, 0, 0], "orientation": [1, 0, 0, 0], "horizontal_fov_deg": 50},
                     {"frame": $frames, "position": [0.1, 0, 0]}]},
 "merge": "depth",
 "lights": [{"ambient": [0.2, 0.2, 0.2]}, {"direction": [-0.4, -1, -0.5]}],
 "output": {"aovs": ${3:-[\"lf.coverage\", \"P\", \"N\", \"albedo\"]}},
 "layers": [$2]}
SHOT
}
render() {  # SHOT OPTIONS...
  local name="$1"
  shift
  raystage render -q "$name.json" -o "$name/f.####.exr" --existing overwrite "$@" 2>&1 |
    grep -o '; [0-9.]* s, [0-9.]* frames/s\|milliseconds a frame.*' | sed "s/^; //; s/^/$name $*: /"
}
shot writing "$solid"
shot light_field "$light_field"
shot mesh "$mesh"
shot both "$light_field, $mesh"
shot mesh_rgbaz "$mesh" '[]'
shot both_rgbaz "$light_field, $mesh" '[]'
for run in 1 2 3; do
  for name in writing light_field mesh both mesh_rgbaz both_rgbaz; do render "$name"; done
done
for name in light_field mesh both both_rgbaz; do render "$name" --frames-in-flight 1; done
if [ -n "${3:-}" ]; then
  bytes=$(stat -c %s both/f.0001.exr)
  seconds=$(raystage render -q both.json -o both/f.####.exr --existing overwrite 2>&1 |
    grep -o '; [0-9.]* s,' | tr -dc '0-9.')
  rate=$(awk "BEGIN {print int($bytes / (0.7 * $seconds / $frames))}")
  echo "a disk of $rate bytes a second, next to an unlimited one:"
  for run in 1 2 3; do
    BAD_DISK_FOLDER="$PWD/both" BAD_DISK="SLOW $rate" LD_PRELOAD="$3" render both
    render both
  done
fi
