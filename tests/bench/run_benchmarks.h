// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage {

/// Of Google Benchmark, all that are registered, with memory kept as every raystage command keeps
/// it. For main(): returns the exit code.
int run_benchmarks(int argc, char** argv);

}  // namespace raystage
