#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures the overhead of a farm job over rendering, and the cost of Slurm's scheduling at 4, 16
# and 64 slots. Measures the error of the cost model for jobs on 1, 2 and 4 nodes. Needs root and
# Debian's slurm-wlm and munge: a cluster on this host.
# Usage: tests/bench/farm.sh BUILD_FOLDER [overhead|scheduling|model]...      about nine minutes
set -euo pipefail
build="$(cd "$1" && pwd)"
shift
parts=" ${*:-overhead scheduling model} "
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
export PATH="$build/bin:$PATH"
work="$(mktemp -d /tmp/rs-bench-XXXX)"
chmod 755 "$work"
cluster() { "$here/../farm/cluster.sh" "$work/c" "$@"; }
trap 'cluster stop >/dev/null 2>&1 || true; rm -rf "$work"' EXIT
TIMEFORMAT='%U %S %R'
# Prints CPU and wall-clock seconds of a command and all of its children.
cost() { { time "$@" >"$work/printed" 2>&1; } 2>&1 | tail -n 1 | awk '{printf "%.2f %.2f\n", $1 + $2, $3}'; }
now() { date +%s.%N; }
since() { awk -v a="$1" -v b="$(now)" 'BEGIN { printf "%.2f", b - a }'; }

cd "$work"
raystage simulate stage -q --rows 4 --columns 4 --width 320 --height 240 --fps 15 --seconds 3.4 --truth-views 0 -o take >/dev/null
raystage sync -q take >/dev/null
cat >shot.json <<'JSON'
{"schema": "raystage/shot/2", "name": "bench", "width": 1920, "height": 1080, "fps": 24,
 "first_frame": 1, "last_frame": 48, "camera": {"keys": [
  {"frame": 1, "position": [-0.03, 0, 0.1], "target": [0, 0, -5], "horizontal_fov_deg": 40},
  {"frame": 48, "position": [0.03, 0, 0.1], "target": [0, 0, -5], "horizontal_fov_deg": 40}]},
 "layers": [{"take": "take", "method": "focal_plane", "focal_plane": {"depth_m": 5}, "start_seconds": 0.2}]}
JSON

overhead() {
  echo "== Overhead: 48 frames of 1920x1080 (shot) and 160x90 (small) in four tasks, CPU seconds"
  CPUS=2 cluster start 1
  export SLURM_CONF="$work/c/slurm.conf"
  # Small frames, because the time to render varies from run to run by more than a task's overhead.
  sed 's/"width": 1920, "height": 1080/"width": 160, "height": 90/' shot.json >small.json
  for shot in shot shot shot small small small; do
    rm -rf plain out
    plain="$(cost raystage render -q $shot.json -o plain/s.####.exr --simd avx2 -j 2)"
    submit="$(cost raystage farm submit -q $shot.json -o out/s.####.exr --no-queue --no-measure --no-preview --chunk 12 -j 2)"
    tasks=0
    for i in 0 1 2 3; do
      # Run the script as Slurm does, including the calls of Slurm's commands.
      task="$(cost env SLURMD_NODENAME=n1 SLURM_JOB_ID=1 SLURM_ARRAY_TASK_ID=$i sh out/s.farm/job-0001/render.sbatch 1 0)"
      tasks="$(awk -v a="$tasks" -v b="$task" 'BEGIN { split(b, x, " "); print a + x[1] }')"
    done
    verify="$(cost env SLURMD_NODENAME=n1 SLURM_JOB_ID=1 sh out/s.farm/job-0001/verify.sbatch 1 0)"
    awk -v n=$shot -v p="$plain" -v s="$submit" -v t="$tasks" -v v="$verify" 'BEGIN {
      split(p, P, " "); split(s, S, " "); split(v, V, " ")
      printf "%s: plain %.2f; four tasks %.2f: %.3f a task more; submission %.2f, verification %.2f: %.2f a job\n", n,
             P[1], t, (t - P[1]) / 4, S[1], V[1], S[1] + V[1] }'
  done
  cluster stop
}

scheduling() {
  echo "== Scheduling: tasks that do nothing"
  printf '#!/bin/sh\n#SBATCH --output=/dev/null --mem=10M\necho "$(date +%%s.%%N)" >>"$1"\n' >nothing.sbatch
  for slots in 4 16 64; do
    rm -rf c
    CPUS=$((slots / 4)) cluster start 4
    sbatch --parsable -W nothing.sbatch "$work/warm" >/dev/null
    rm -f started latency
    for i in 1 2 3 4 5; do  # one task, every slot free
      rm -f one
      start="$(now)"
      sbatch --parsable nothing.sbatch "$work/one" >/dev/null
      until [ -s one ]; do sleep 0.02; done
      awk -v a="$start" '{ print $1 - a }' one >>latency
      sleep 1
    done
    start="$(now)"
    sbatch --parsable --array=0-255 nothing.sbatch "$work/started" >/dev/null
    until [ "$(cat started 2>/dev/null | wc -l)" -ge 256 ]; do sleep 0.1; done
    seconds="$(since "$start")"
    printf '%3d slots: latency %s s (median of 5), 256 tasks in %s s: %s starts a second\n' "$slots" \
      "$(sort -n latency | sed -n 3p | cut -c1-5)" "$seconds" "$(awk -v s="$seconds" 'BEGIN { printf "%.1f", 256 / s }')"
    cluster stop
  done
}

model() {
  echo "== Model against a job of 48 frames in 24 tasks of one thread, on nodes of half a processor each"
  for nodes in 1 2 4; do
    rm -rf c out
    NODE_SHARE=50 cluster start $nodes
    export SLURM_CONF="$work/c/slurm.conf"
    start="$(now)"
    raystage farm submit -q shot.json -o out/s.####.exr --no-measure --no-preview --chunk 2 -j 1 >/dev/null
    until [ -e out/s.farm/job-0001/ended.json ]; do sleep 0.2; done
    echo "$nodes nodes: $(since "$start") s; tasks: $(raystage farm estimate out/s.farm/job-0001 --cores 1 --nodes $nodes | tail -n 1)"
    cluster stop
    [ $nodes = 1 ] || continue
    raystage farm estimate out/s.farm/job-0001 --cores 1 --nodes 1,2,4,10,100,1000
  done
  echo "== Model of a large job, from a job on one node of one processor"
  rm -rf c out
  cluster start 1
  raystage farm submit -q shot.json -o out/s.####.exr --no-measure --no-preview --chunk 2 -j 1 >/dev/null
  until [ -e out/s.farm/job-0001/ended.json ]; do sleep 0.2; done
  raystage farm estimate out/s.farm/job-0001 --cores 2 --nodes 1,10,100,1000 --frames 4800 --tasks 960 \
    --storage-write 1200 -o "$build/farm-scaling.html"
  cluster stop
}

for part in overhead scheduling model; do
  [[ "$parts" != *" $part "* ]] || "$part"
done
