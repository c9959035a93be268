#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures the traffic between MPI ranks that render a shot from archives on several hosts, and its cost.
# Usage: tests/bench/ranks.sh BUILD_FOLDER [traffic|latency|jpeg|cpu|scaling|crossover]...     about eight minutes
# Traffic and latency are drawn in BUILD_FOLDER/ranks.html.
set -euo pipefail
build="$(cd "$1" && pwd)"
shift
parts=" ${*:-traffic latency jpeg cpu scaling crossover} "
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
export PATH="$build/bin:$PATH" OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
work="$(mktemp -d /tmp/rs-bench-XXXX)"
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir cache
TIMEFORMAT='%U %S %R'
processors="0-$(($(nproc) - 1))"
# ranks N TAKE SHOT OPTION...: renders with N ranks of one thread and prints their output
ranks() {
  local n="$1" take="$2" shot="$3"
  shift 3
  mpirun --oversubscribe --bind-to none -n "$n" --mca btl tcp,self --mca btl_tcp_if_include lo --mca oob_tcp_if_include lo \
    raystage render "$shot" -o "ranks/s.####.exr" --existing overwrite -j 1 \
    --take-folder "$work/$take=$work/$take.$n/{rank}/take" "$@" 2>&1
}
# array SIDE SPACING_MM: a take of SIDE x SIDE cameras that span the same square, split over 1, 2 and 4 ranks
array() {
  [ -e "take$1" ] && return
  raystage simulate stage -q --rows "$1" --columns "$1" --spacing-mm "$2" --width 320 --height 240 --fps 15 \
    --seconds 4.2 --truth-views 0 -o "take$1" >/dev/null
  raystage sync -q "take$1" >/dev/null
  for n in 1 2 4; do "$here/../farm/split_take.py" "take$1" "take$1.$n" "$n"; done
}
# shot TAKE METHOD OPTIONS FRAMES SIZE: writes a shot and prints its name
shot() {
  cat >"$1.$2.json" <<JSON
{"schema": "raystage/shot/2", "width": $5, "height": $5, "fps": 15, "first_frame": 1, "last_frame": $4,
 "camera": {"keys": [
  {"frame": 1, "position": [-0.06, 0.03, 0.42], "target": [0, 0, -5], "horizontal_fov_deg": 50},
  {"frame": $4, "position": [0.06, -0.03, 0.42], "target": [0, 0, -5], "horizontal_fov_deg": 50}]},
 "layers": [{"take": "$1", "method": "$2", "options": $3, "focal_plane": {"depth_m": 5}, "start_seconds": 0.2}]}
JSON
  echo "$1.$2.json"
}
local_render() { raystage render "$1" -o local/s.####.exr --existing overwrite -j 1 --cache "$work/cache" 2>&1; }

if [[ "$parts" = *" traffic "* ]]; then
  echo "== Samples sent between four ranks, per pixel of the view (512x512, focal_plane, 16 frames of a path)"
  for side in 2 4 8; do
    array $side $((420 / (side - 1)))
    name="$(shot take$side focal_plane '{}' 16 512)"
    said="$(ranks 4 take$side "$name" | grep '^between')"
    echo "$((side * side)) cameras: $said"
    case $side in 2) bar=3.1 ;; 4) bar=1.6 ;; 8) bar=1.25 ;; esac
    echo "traffic $((side * side)) $(cut -d ' ' -f 3 <<<"$said") $bar" >>measured
  done
fi
if [[ "$parts" = *" latency "* ]]; then
  array 8 60
  name="$(shot take8 focal_plane '{}' 48 512)"
  echo "== Latency of a view, milliseconds (64 cameras, 512x512, 48 frames of a path)"
  for n in 2 4; do
    said="$(ranks $n take8 "$name")"
    echo "$n ranks: $(grep '^milliseconds' <<<"$said")"
    echo "$n ranks: $(grep -o 'milliseconds a view.*' <<<"$said")"
    [ $n = 2 ] || continue
    # The numbers of both lines, in order.
    read -r light_fields encode <<<"$(sed -n 's/^milliseconds a frame.*light fields \([0-9.]*\),.*encoding \([0-9.]*\);.*/\1 \2/p' <<<"$said")"
    read -r own wait add other_own other_add other_encode messages <<<"$(
      grep -o 'milliseconds a view.*' <<<"$said" | grep -oE '[0-9]+[.][0-9]+' | tr '\n' ' ')"
    awk -v all="$light_fields" -v own="$own" -v wait="$wait" -v add="$add" -v other="$other_own" -v below="$other_add" \
      -v pack="$other_encode" -v messages="$messages" -v file="$encode" 'BEGIN {
      print "latency", messages, "messages"
      print "latency", other, "sampling"
      print "latency", below + pack, "encoding"
      print "latency", add, "adding"
      print "latency", all - own - wait - add, "finishing"
      print "latency", file, "EXR file" }' >>measured
  done
fi
if [[ "$parts" = *" jpeg "* ]]; then
  echo "== JPEG fragments: bytes of a frame of 512x512, and PSNR (sRGB codes) against the exact frame"
  for side in 2 4 8; do
    array $side $((420 / (side - 1)))
    name="$(shot take$side focal_plane '{}' 16 512)"
    local_render "$name" >/dev/null
    for quality in 80 83 85; do
      said="$(ranks 4 take$side "$name" --fragments jpeg --fragment-quality $quality | grep '^between')"
      db=0
      for frame in 0001 0006 0011 0016; do
        for which in local ranks; do
          oiiotool -q $which/s.$frame.exr --subimage 0 --ch R,G,B --colorconvert linear sRGB -d uint8 -o $which.png
        done
        one="$({ idiff -a local.png ranks.png || true; } | sed -n 's/.*Peak SNR = //p')"
        db="$(awk -v a="$db" -v b="$one" 'BEGIN { print a + b / 4 }')"
      done
      echo "$((side * side)) cameras, quality $quality: $(awk -v s="$said" -v db="$db" 'BEGIN {
        split(s, part, ", "); split(part[3], x, " "); printf "%.1f KB a frame, %.2f dB", x[1] * 1000 / 16, db }')"
    done
  done
fi
cost_of_local() { { time local_render "$1" >said; } 2>&1 | tail -n 1 | awk '{ printf "%.2f\n", $1 + $2 }'; }
if [[ "$parts" = *" cpu "* ]]; then
  array 8 60
  echo "== CPU seconds of all ranks without waiting, and of one process of one thread (complete commands, one processor)"
  # On real hosts each rank has its own processor. Here all ranks share one, with time slices of 100
  # ms instead of 3, because ranks that alternate evict each other's cache lines. Ranks on sibling
  # cores would share caches.
  taskset -cp 0 $$ >/dev/null
  chrt -r -p 1 $$ 2>/dev/null || echo "(short time slices: real-time scheduling is not allowed here)"
  for row in "focal_plane {} 48 512" 'depth {"near":2,"far":12} 4 512'; do
    read -r method options frames size <<<"$row"
    name="$(shot take8 "$method" "$options" "$frames" "$size")"
    for run in 1 2 3; do
      rm -rf cache && mkdir cache
      alone="$(cost_of_local "$name")"
      said="$(ranks 4 take8 "$name")"
      awk -v m="$method" -v a="$alone" -v s="$(grep '^all ranks' <<<"$said")" 'BEGIN {
        split(s, x, " "); together = x[3] - x[6]
        printf "%s: alone %.2f, four ranks %.2f (and %.2f waiting): %.2f times\n", m, a, together, x[6], together / a }'
    done
    grep -E '^(all ranks|milliseconds|between)' <<<"$said"
  done
  chrt -o -p 0 $$
  taskset -cp "$processors" $$ >/dev/null
fi
if [[ "$parts" = *" scaling "* ]]; then
  array 8 60
  name="$(shot take8 focal_plane '{}' 48 512)"
  echo "== Frames a second, ranks of one thread"
  for n in 1 2 4; do
    if [ $n = 1 ]; then said="$(local_render "$name")"; else said="$(ranks $n take8 "$name")"; fi
    echo "$n: $(grep -o '[0-9.]* frames/s' <<<"$said"); $(grep '^milliseconds' <<<"$said")"
  done
fi
if [[ "$parts" = *" crossover "* ]]; then
  array 8 60
  name="$(shot take8 focal_plane '{}' 16 512)"
  echo "== Bytes of archives read against bytes sent, for one frame (64 cameras of 320x240, view 512x512)"
  archives="$(du -cb take8/archive/*.mkv | tail -n 1 | cut -f 1)"
  frames="$(raystage info take8 | sed -n 's/^Frames *\([0-9]*\).*/\1/p')"
  said="$(local_render "$name")"
  echo "archives: $archives bytes, ${frames:-?} frames"
  echo "one process: $(grep '^milliseconds' <<<"$said")"
  for fragments in float half jpeg; do
    echo "$fragments: $(ranks 4 take8 "$name" --fragments $fragments | grep '^between')"
  done
fi
if [ -e measured ]; then ranks_page <measured >"$build/ranks.html"; fi
