// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <cstddef>

#include "base/resources.h"

namespace raystage {

/// Adds -j, --threads N; 0, the default, is the number that this process may use.
inline void add_threads_option(CLI::App& app, int& threads) {
  app.add_option("-j,--threads", threads,
                 "Threads (default: 0, as many as CPU affinity and control group grant)")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
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

}  // namespace raystage
