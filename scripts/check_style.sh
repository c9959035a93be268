#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs clang-format on every source, and clang-tidy on all but the example (which is compiled against an
# installation), but not on contents that passed before. Files that git does not track yet are checked, too.
# Usage: scripts/check_style.sh BUILD_FOLDER
# The cache of passed contents is in BUILD_FOLDER; on a build server (CI=true) in the home folder,
# for all checkouts.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build="$1"
mapfile -t sources < <(git ls-files --cached --others --exclude-standard --deduplicate '*.cpp' '*.h')
clang-format-14 --dry-run -Werror "${sources[@]}"
echo "${#sources[@]} files are formatted as .clang-format says"

# Several sources are checked at a time, without precompiled headers.
commands="$build/clang-tidy"
cmake -S . -B "$commands" -G Ninja -DCMAKE_BUILD_TYPE=Release -DRAYSTAGE_BENCHMARKS=ON \
  -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=16 \
  -DRAYSTAGE_PRECOMPILED_HEADERS=OFF >/dev/null
ninja -C "$commands" schemas/embedded_schemas.cpp >/dev/null  # a source that CMake writes
cache="$build/clang-tidy-passed"
[ "${CI:-}" != true ] || cache="${RAYSTAGE_TIDY_CACHE:-$HOME/.cache/raystage-clang-tidy}"
mapfile -t checked < <(git ls-files --cached --others --exclude-standard --deduplicate '*.cpp' ':!examples')
scripts/clang_tidy.py "$commands" "$cache" "${checked[@]}"
