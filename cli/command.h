// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>

#include "base/error.h"

namespace raystage {

/// A command's body: works on parsed options; `stop` is requested by SIGINT and SIGTERM.
using CommandBody = std::function<ExitCode(std::stop_token stop)>;

/// What a signal asks for.
enum class OnSignal {
  kAbort,  ///< to give up: exit code 128 + the signal's number, unless all was done all the same
  kEnd     ///< the command's proper end: the body's exit code
};

/// Runs a command to its exit code. Errors and unexpected exceptions become one line on stderr
/// ("raystage NAME: where: what. What to do."). After a signal the body has its time to stop.
int run_command(std::string_view name, const CommandBody& body,
                OnSignal on_signal = OnSignal::kAbort);

/// How progress is shown on stderr.
enum class ProgressStyle {
  kAuto,    ///< a bar where a terminal watches, otherwise kPlain
  kPlain,   ///< lines "Progress: 42%", at most two a second and the last
  kOpenJd,  ///< lines "openjd_progress: 42" (Open Job Description)
  kNone
};

/// The exit code that render managers agree on for "try again with more memory".
inline constexpr int kOutOfMemoryCode = 33;

/// Progress on stderr: flushed, only rising. Thread-safe.
class Progress {
 public:
  explicit Progress(bool enabled = true)
      : Progress(enabled ? ProgressStyle::kAuto : ProgressStyle::kNone) {}
  explicit Progress(ProgressStyle style);
  /// `done` in [0, 1].
  void report(double done);
  /// A line of text on stderr that does not run into the bar.
  void say(std::string_view line);

 private:
  void draw_bar() const;

  ProgressStyle style_;
  bool bar_ = false;  ///< kAuto on a terminal
  int percent_ = -1;
  std::chrono::steady_clock::time_point last_line_{};
  std::mutex mutex_;
};

}  // namespace raystage
