// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cstddef>

#include "base/error.h"
#include "base/resources.h"
#include "cli/command_line.h"

namespace raystage::cli {

/// Adds -j, --threads N; 0, the default, is the number that this process may use.
inline void add_threads_option(CommandLine& command, int& threads) {
  command
      .option("-j,--threads N", threads,
              "Threads (default: 0, as many as CPU affinity and control group grant)")
      .range(0, 1024);
}

inline int thread_count(int threads_option) {
  return threads_option > 0 ? threads_option : available_threads();
}

/// Limits TBB to this number of threads during its lifetime.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads_option)
      : limit_(tbb::global_control::max_allowed_parallelism,
               static_cast<std::size_t>(thread_count(threads_option))) {}

 private:
  tbb::global_control limit_;
};

/// Returns what `run()` returns, run with this number of threads.
template <class Run>
ExitCode run_with_threads(int threads_option, const Run& run) {
  const ThreadLimit limit(threads_option);
  tbb::task_arena arena(thread_count(threads_option));
  return arena.execute(run);
}

}  // namespace raystage::cli
