#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs one libFuzzer program, from the inputs that earlier runs found on.
#   scripts/fuzz_target.sh SECONDS PROGRAM         looks for faults; prints executions and seconds
#   scripts/fuzz_target.sh keep PROGRAM            keeps the inputs that were found: tests/fuzz/found/NAME.tar.zst
set -euo pipefail
what="$1" program="$2"
name="$(basename "$program" _fuzz)"
project="$(cd "$(dirname "$0")/.." && pwd)"
work="$(cd "$(dirname "$program")/.." && pwd)/fuzzing/$name"
seeds="$project/tests/fuzz/corpus/$name" kept="$project/tests/fuzz/found/$name.tar.zst"
mkdir -p "$work/found" "$work/faults"
[ -d "$seeds" ] || seeds=
[ ! -f "$kept" ] || tar --extract --zstd --skip-old-files --directory "$work/found" --file "$kept"

if [ "$what" = keep ]; then
  # The fewest inputs that reach what all of them reach.
  rm -rf "$work/smallest" && mkdir "$work/smallest"
  "$program" -merge=1 -rss_limit_mb=2048 "$work/smallest" ${seeds:+"$seeds"} "$work/found" >"$work/merge.log" 2>&1
  mkdir -p "$(dirname "$kept")"
  tar --create --directory "$work/smallest" --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner . |
    zstd --quiet --force -19 -o "$kept"
  exit
fi

log="$work/run.log"
if ! "$program" -max_total_time="$what" -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 \
    -artifact_prefix="$work/faults/" "$work/found" ${seeds:+"$seeds"} >"$log" 2>&1; then
  tail -n 60 "$log"
  echo "$name: a fault. The input is in $work/faults" >&2
  exit 1
fi
echo "$name: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") executions in $what s"
