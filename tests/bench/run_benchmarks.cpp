// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/run_benchmarks.h"

#include <benchmark/benchmark.h>
#include <malloc.h>

namespace raystage {

int run_benchmarks(int argc, char** argv) {
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace raystage
