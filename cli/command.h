// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>

#include "base/error.h"

namespace raystage::cli {

/// Body of a command, called after parsing; SIGINT and SIGTERM request `stop`.
using CommandBody = std::function<ExitCode(std::stop_token stop)>;

/// Effect of a signal.
enum class OnSignal {
  kAbort,  ///< exit code 128 + the signal's number, unless all work was done
  kEnd     ///< normal end of the command: the body's exit code
};

/// Runs a command and returns its exit code. Errors and unexpected exceptions become one line on
/// stderr ("raystage NAME: where: what. What to do."). After a signal the body has time to stop.
int run_command(std::string_view name, const CommandBody& body,
                OnSignal on_signal = OnSignal::kAbort);

/// Style of progress on stderr.
enum class ProgressStyle {
  kAuto,    ///< a bar on a terminal, otherwise kPlain
  kPlain,   ///< lines "Progress: 42%", at most two a second and the last
  kOpenJd,  ///< lines "openjd_progress: 42" (Open Job Description)
  kNone
};

/// Exit code after which render managers retry with more memory.
inline constexpr int kOutOfMemoryCode = 33;

/// Progress on stderr, flushed and never decreasing. Thread-safe.
class Progress {
 public:
  explicit Progress(bool enabled = true)
      : Progress(enabled ? ProgressStyle::kAuto : ProgressStyle::kNone) {}
  explicit Progress(ProgressStyle style);
  /// Shows the progress. `done`: in [0, 1].
  void report(double done);
  /// Prints a line of text on stderr without overwriting the bar.
  void say(std::string_view line);

 private:
  void draw_bar() const;

  ProgressStyle style_;
  bool bar_ = false;  ///< kAuto on a terminal
  int percent_ = -1;
  std::chrono::steady_clock::time_point last_line_{};
  std::mutex mutex_;
};

}  // namespace raystage::cli
