#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# clang-format on every source; clang-tidy on the product's (not the tests'), where it is not known to
# have passed before: neither here nor at the commit of clang_tidy_baseline.txt. To move that on: write
# "none" into it, run this, write the commit.
# Usage: scripts/check_style.sh BUILD_FOLDER (which keeps what passed)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build="$1"
mapfile -t sources < <(git ls-files '*.cpp' '*.h')
clang-format-14 --dry-run -Werror "${sources[@]}"
echo "${#sources[@]} files are formatted as .clang-format says"

# What passed once needs no second look: the stamp is a hash of the checks, the file, every header of
# ours and how the build is described.
stamps="$build/clang-tidy-passed"
mkdir -p "$stamps"
headers="$(git ls-files '*.h' '*.in' '*CMakeLists.txt' 'cmake/*' CMakePresets.json .clang-tidy | xargs cat | sha256sum | cut -d' ' -f1)"
todo=()
mapfile -t product < <(git ls-files '*.cpp' ':!tests' ':!*_test.cpp')
mapfile -t affected < <(scripts/affected_sources.py "${product[@]}")
echo "clang-tidy: ${#product[@]} files, ${#affected[@]} of them touched since all passed"
for source in "${affected[@]}"; do
  stamp="$stamps/$( (echo "$headers"; cat "$source") | sha256sum | cut -d' ' -f1)"
  [ -e "$stamp" ] || todo+=("$source=$stamp")
done
echo "clang-tidy: ${#todo[@]} files to look at"
if [ ${#todo[@]} -eq 0 ]; then
  echo "clang-tidy has no complaint"
  exit 0
fi
# Every file by itself, with nothing precompiled: it must include what it uses.
commands="$build/clang-tidy"
cmake -S . -B "$commands" -G Ninja -DCMAKE_BUILD_TYPE=Release -DRAYSTAGE_BENCHMARKS=ON \
  -DRAYSTAGE_PRECOMPILED_HEADERS=OFF >/dev/null
printf '%s\n' "${todo[@]}" | xargs -P "$(nproc)" -I{} bash -c '
  pair="$1"; source="${pair%%=*}"; stamp="${pair#*=}"
  if clang-tidy-14 --quiet --extra-arg=-Wno-unknown-warning-option -p "$2" "$source" 2>"$stamp.log"; then
    rm -f "$stamp.log"; touch "$stamp"
  else
    cat "$stamp.log" >&2; rm -f "$stamp.log"; exit 1
  fi
' _ {} "$commands"
echo "clang-tidy has no complaint"
