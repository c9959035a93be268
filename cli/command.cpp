// SPDX-License-Identifier: Apache-2.0
#include "cli/command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <new>
#include <thread>

namespace raystage {
namespace {

// A signal handler can reach nothing but statics; this one only writes the number to a pipe, and a
// thread turns it into a stop request.
std::array<int, 2> signal_pipe{-1, -1};

void on_signal(int number) {
  const auto byte = static_cast<unsigned char>(number);
  [[maybe_unused]] const ssize_t written = write(signal_pipe[1], &byte, 1);
}

class SignalWatch {
 public:
  SignalWatch() {
    if (pipe(signal_pipe.data()) != 0) return;
    thread_ = std::thread([this] {
      unsigned char number = 0;
      while (read(signal_pipe[0], &number, 1) == 1 && number != 0) {
        signal_ = number;
        source_.request_stop();
      }
    });
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    std::signal(SIGPIPE, SIG_IGN);
  }
  ~SignalWatch() {
    if (!thread_.joinable()) return;
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
    on_signal(0);
    thread_.join();
    close(signal_pipe[0]);
    close(signal_pipe[1]);
  }
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  std::stop_token token() const { return source_.get_token(); }
  int signal() const { return signal_; }

 private:
  std::stop_source source_;
  std::atomic<int> signal_ = 0;
  std::thread thread_;
};

}  // namespace

int run_command(std::string_view name, const CommandBody& body) {
  const auto complain = [&](std::string_view text) {
    fmt::print(stderr, "raystage {}: {}\n", name, text);
    std::fflush(stderr);
  };
  SignalWatch watch;
  int code = static_cast<int>(ExitCode::kFailed);
  try {
    code = static_cast<int>(body(watch.token()));
  } catch (const Error& error) {
    if (watch.signal() == 0) complain(error.what());
    code = static_cast<int>(error.exit_code());
  } catch (const std::bad_alloc&) {
    complain("out of memory. Use fewer threads or a smaller --memory.");
    code = 33;  // the farms' agreed code for "retry with more memory"
  } catch (const std::exception& error) {
    complain(fmt::format("unexpected: {}. Please report this.", error.what()));
  }
  if (watch.signal() != 0 && code != 0) {
    complain("stopped; nothing half-written was left");
    return 128 + watch.signal();
  }
  return code;
}

Progress::Progress(bool enabled) : enabled_(enabled), terminal_(isatty(STDERR_FILENO) == 1) {}

void Progress::report(double done) {
  if (!enabled_) return;
  const int percent = std::clamp(static_cast<int>(done * 100), 0, 100);
  const std::scoped_lock lock(mutex_);
  if (percent <= percent_) return;
  percent_ = percent;
  if (terminal_) {
    constexpr int kWidth = 40;
    const int filled = percent * kWidth / 100;
    fmt::print(stderr, "\r[{:=<{}}{: <{}}] {:3}%{}", "", filled, "", kWidth - filled, percent,
               percent == 100 ? "\n" : "");
  } else {
    fmt::print(stderr, "Progress: {}%\n", percent);
  }
  std::fflush(stderr);
}

}  // namespace raystage
