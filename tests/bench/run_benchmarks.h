// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage {

/// Runs all registered benchmarks of Google Benchmark with the memory settings of raystage
/// commands. Returns the exit code for main().
int run_benchmarks(int argc, char** argv);

}  // namespace raystage
