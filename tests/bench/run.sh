#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds and runs the benchmarks that docs/benchmarks.md quotes.
# Usage: tests/bench/run.sh [DATA_FOLDER]    (default: $RAYSTAGE_DATA or ../shared/data next to the
# checkout; without its shop/ light field a painted plane is used)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
data="${1:-${RAYSTAGE_DATA:-../shared/data}}"
build=build/check
cmake --preset check >/dev/null
cmake --build "$build" -j "$(nproc)" >/dev/null
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
if [ -e "$data/shop/import.json" ]; then
  # shop is static: each of its pictures becomes 16 frames, so that a shot through it decodes as many
  # frames as through a moving take.
  python3 - "$data/shop" "$work/import.json" <<'PYTHON'
import json, pathlib, sys
folder, target = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
manifest = json.loads((folder / "import.json").read_text())
for camera in manifest["cameras"]:
    (picture,) = camera["frames"]
    camera["frames"] = [{"file": str(folder / picture["file"]), "time_ns": i * 66666667}
                        for i in range(16)]
pathlib.Path(target).write_text(json.dumps(manifest))
PYTHON
  for variant in restart plain; do
    options=()
    [ "$variant" = plain ] || options=(--restart-markers)
    "$build/bin/raystage" import "$work/import.json" -o "$work/$variant" "${options[@]}" >/dev/null 2>&1
  done
  export RAYSTAGE_BENCH_TAKE="$work/restart" RAYSTAGE_BENCH_TAKE_PLAIN="$work/plain"
else
  echo "$data/shop is missing: the benchmark uses a painted plane" >&2
fi
"$build/bin/focal_plane_bench"
"$build/bin/methods_bench"
"$build/bin/thesis_bench"
"$build/bin/plane_sweep_bench"
"$build/bin/jpeg_bench"
