#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures the error and time of calibration with simulated arrays of known truth. Geometry: the
# thesis' 8x8 array from a moving light, from frames and from detections. Colours: 16 cameras by
# targets, by a chart and by the scene, and their effect on rendered views.
# Usage: tests/bench/calibrate.sh [FOLDER]     (default: a temporary folder)
#   `raystage` must be on the PATH, e.g. PATH=$PWD/build/check/bin:$PATH. Takes about fifteen minutes.
set -euo pipefail
folder="${1:-$(mktemp -d)}"
mkdir -p "$folder"
cd "$folder"

seconds() {  # COMMAND...
  local start end
  start=$(date +%s.%N)
  "$@" >out.txt 2>err.txt || { cat out.txt err.txt >&2; exit 1; }
  end=$(date +%s.%N)
  awk "BEGIN {printf \"%.1f s\", $end - $start}"
}
worst_of() {  # COMPARISON.json
  python3 - "$1" <<'PYTHON'
import json, sys
cameras = json.load(open(sys.argv[1]))["cameras"]
print(f'positions within {1000 * max(c["place_m"] for c in cameras):.3f} mm, '
      f'directions within {max(c["turn_deg"] for c in cameras):.4f} degrees, '
      f'pixels within {max(c["rms_px"] for c in cameras):.3f}')
PYTHON
}
true_rig() {  # TAKE FILE [KEEP...]: named colour fields; of =CAMERA also contrast, brightness
  python3 - "$@" <<'PYTHON'
import json, sys
take, file, *keep = sys.argv[1:]
rig = json.load(open(take + "/truth.json"))["rig"]
for camera in rig["cameras"]:
    colours = camera.get("photometric", {})
    if keep == ["all"]: continue
    known = keep + (["contrast", "brightness"] if "=" + camera["id"] in keep else [])
    camera["photometric"] = {"contrast": [1, 1, 1], "brightness": [0, 0, 0],
                             **{k: colours[k] for k in known if k in colours}}
json.dump(rig, open(file, "w"))
PYTHON
}

echo "## The thesis' 8x8 array, 640x480, 62 degrees, 5 % distortion, from a moving light"
if [ ! -e light/truth.json ]; then
  raystage simulate moving_light -o light --rows 8 --columns 8 --width 640 --height 480 --seconds 14 \
    --fps 10 --mounting-deg 4 --mounting-mm 8 --lens-deviation 0 --k1 -0.089 --k2 0 \
    --calibration nominal -q
fi
true_rig light light_truth.json all
echo "from $(ls light/archive/*.mkv | wc -l) archives: $(seconds raystage calibrate geometry light \
  --spacing-mm 60 -o light.json --detections light.csv -q)"
grep -h "^Fit\|^Clocks" out.txt
raystage calibrate compare --json light_truth.json light.json >compared.json
worst_of compared.json
echo "from its detections: $(seconds raystage calibrate geometry light.csv \
  --cameras light.cameras.json --spacing-mm 60 -o again.json -q)"

colours() {  # SCENE REFERENCE RIG...: PSNR of views with known truth, by rig
  local scene="$1" reference="$2"
  shift 2
  for rig in "$@"; do
    # The reference camera scales them to the truth, because no target determines the scale. Each
    # channel has its own scale, unless channels mix.
    python3 - "$scene" "$reference" "$rig" <<'PYTHON'
import json, sys
scene, reference, name = sys.argv[1:]
truth = json.load(open(scene + "/truth.json"))["rig"]
rig = json.load(open(name + ".json"))
same = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
def slopes(of):
    p = [c for c in of["cameras"] if c["id"] == reference][0].get("photometric", {})
    return [sum(m * c for m, c in zip(row, p.get("contrast", [1] * 3))) for row in p.get("matrix", same)]
scale = [a / b for a, b in zip(slopes(truth), slopes(rig))]
mixes = any("matrix" in c["photometric"] for c in truth["cameras"])
if mixes: scale = [scale[1]] * 3
for camera in rig["cameras"]:
    if name in ("none", "true"): break
    p = camera.setdefault("photometric", {"contrast": [1, 1, 1], "brightness": [0, 0, 0]})
    p["matrix"] = [[k * x for x in row] for k, row in zip(scale, p.get("matrix", same))]
json.dump(rig, open(scene + "/rig.json", "w"))
PYTHON
    for method in plane_sweep focal_plane; do
      echo "$rig $method: $(raystage evaluate "$scene" "$scene/views.json" --method "$method" \
        2>/dev/null | awk '/^mean/ {print $2, "dB"}')"
    done
  done
}
brightest_black() {  # TAKE: prints the camera with the highest black level
  python3 - "$1" <<'PYTHON'
import json, sys
cameras = json.load(open(sys.argv[1] + "/truth.json"))["rig"]["cameras"]
def black(c): return min(-b / g for b, g in zip(c["photometric"]["brightness"], c["photometric"]["contrast"]))
print(max(cameras, key=black)["id"])
PYTHON
}
array="--rows 4 --columns 4 --startup-loss-seconds 0 --drop 0 --gain 0.2 --white-balance 0.1 --offset 0.031 --vignetting 0.3"

echo "## Colours of 16 cameras, 320x240, 30 hot pixels each"
small="$array --width 320 --height 240 --hot-pixels 30 --mounting-mm 0 --mounting-deg 0 --lens-deviation 0 --noise 0.01 --quality 97"
for target in white grey black; do
  [ -e $target ] || raystage simulate $target -o $target $small --seconds 1 --fps 12 --truth-views 0 -q
done
[ -e scene ] || raystage simulate still -o scene $small --seconds 0.5 --fps 10 --truth-views 6 -q
true_rig scene true.json all
true_rig scene none.json
true_rig scene known.json =r0c0
true_rig scene lenses.json vignetting dark_pixels =r0c0
raystage calibrate color white grey --dark black --vignetting --initial-rig none.json -o targets.json
raystage calibrate color white grey --dark black --flat-field --initial-rig none.json -o map.json
echo "by the scene, without vignetting and hot pixels: $(seconds raystage calibrate color --scene scene \
  --initial-rig known.json -o scene.json -q)"
cat out.txt
raystage calibrate color --scene scene --initial-rig lenses.json -o scene_lenses.json -q
colours scene r0c0 none targets map scene scene_lenses true

echo "## Colours of 16 cameras, 640x480, with up to 15 % crosstalk between channels"
mixed="$array --width 640 --height 480 --color-mix 0.15"
for target in white grey black color_chart; do
  [ -e mixed_$target ] || raystage simulate $target -o mixed_$target $mixed --seconds 1 --fps 12 \
    --noise 0.02 --quality 95 --truth-views 0 -q
done
[ -e mixed ] || raystage simulate stage -o mixed $mixed --seconds 0.6 --fps 10 --truth-views 6 -q
raystage sync mixed -q >/dev/null
true_rig mixed true.json all
true_rig mixed none.json
reference=$(brightest_black mixed)
by_targets="mixed_white mixed_grey --dark mixed_black --vignetting --reference $reference --initial-rig none.json"
raystage calibrate color $by_targets -o targets.json
raystage calibrate color $by_targets --chart mixed_color_chart --reference-values -o chart.json \
  --contact-sheet chart.jpg --contact-sheet-take mixed
colours mixed "$reference" none targets chart true
