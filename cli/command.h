// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>

#include "schemas/error.h"

namespace raystage {

/// A command's body: works on parsed options; `stop` is requested by SIGINT and SIGTERM.
using CommandBody = std::function<ExitCode(std::stop_token stop)>;

/// Runs a command to its exit code. Errors and unexpected exceptions become one line on stderr
/// ("raystage NAME: where: what. What to do."). After a signal the body has its time to stop; the
/// process then exits with 128 + the signal's number.
int run_command(std::string_view name, const CommandBody& body);

/// Progress on stderr: a bar where a terminal watches, otherwise lines "Progress: 42%", flushed,
/// only rising. Thread-safe.
class Progress {
 public:
  explicit Progress(bool enabled = true);
  /// `done` in [0, 1].
  void report(double done);

 private:
  bool enabled_, terminal_;
  int percent_ = -1;
  std::mutex mutex_;
};

}  // namespace raystage
