#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs missing packages, builds with warnings as errors, and runs the tests.
#   ./test.sh            all checks and tests that a change must pass
#   ./test.sh fast       builds and runs the tests without the label `slow`
#   ./test.sh asan|tsan  all tests under that sanitizer
#   ./test.sh fuzz [S]   every fuzz target for S seconds (default 60)
set -euo pipefail
cd "$(dirname "$0")"
what="${1:-all}"
jobs="$(nproc)"
# Property tests repeat the same cases; RC_PARAMS="max_success=20000" ./test.sh tries more.
export RC_PARAMS="${RC_PARAMS:-seed=20051}"

step() { printf '\n== %s (%ss since start)\n' "$1" "$SECONDS"; }

if [ -z "${RAYSTAGE_SKIP_INSTALL:-}" ]; then
  step "packages"
  scripts/install_packages.sh build run test
fi

configure_and_build() {  # PRESET [BUILD OPTION...]
  cmake --preset "$1" >"build/$1.configure.log" 2>&1 || { cat "build/$1.configure.log"; exit 1; }
  cmake --build "build/$1" -j "$jobs" "${@:2}"
}
mkdir -p build

run_tests() {  # PRESET [CTEST OPTION...]
  local log="build/$1.tests.log"
  # One more than there are processors: many tests wait for disks, clocks or other processes.
  if ctest --test-dir "build/$1" -j "$((jobs + 1))" --no-tests=error --output-on-failure "${@:2}" >"$log" 2>&1; then
    grep -E '\(Skipped\)|tests passed|Total Test time' "$log"
  else
    # Print the failed tests with their output; the log has the rest.
    awk '/^ *[0-9]+\/[0-9]+ Test +#/ { show = /\*\*\*/ && !/\*\*\*Skipped/ } /tests passed/ { show = 1 }
         show && !/^ +Start +[0-9]+:/' "$log"
    echo "The whole log: $log" >&2
    exit 1
  fi
}

sanitizer_options() {
  export ASAN_OPTIONS="detect_leaks=1:strict_string_checks=1:detect_stack_use_after_return=1"
  export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0"
  export UBSAN_OPTIONS="print_stacktrace=1"
  export TSAN_OPTIONS="suppressions=$PWD/tests/tsan.supp:halt_on_error=1:history_size=7:second_deadlock_stack=1"
}

case "$what" in
  all)
    step "build, warnings are errors"
    configure_and_build check
    step "tests"
    run_tests check
    step "quick form of the address and undefined behaviour sanitizers"
    sanitizer_options
    configure_and_build asan_quick --target sanitizer_quick
    run_tests asan_quick -L '^(base|schemas|jpeg|store|frames|fixity|frame_exr)$'
    step "clang-format and clang-tidy"
    scripts/check_style.sh build/check
    step "done"
    ;;
  fast)
    step "build, warnings are errors"
    configure_and_build check
    step "tests without the label slow"
    run_tests check -LE '^slow$'
    ;;
  asan | tsan)
    step "build with $what"
    configure_and_build "$what"
    step "tests with $what"
    sanitizer_options
    run_tests "$what"
    ;;
  fuzz)
    step "build fuzz targets"
    configure_and_build fuzz
    step "fuzz, $jobs targets at a time"
    printf '%s\n' build/fuzz/bin/*_fuzz | xargs -P "$jobs" -n 1 scripts/fuzz_target.sh "${2:-60}"
    ;;
  *)
    echo "usage: ./test.sh [all|fast|asan|tsan|fuzz [SECONDS]]" >&2
    exit 2
    ;;
esac
