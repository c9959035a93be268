// SPDX-License-Identifier: Apache-2.0
#include "cli/command.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <new>
#include <system_error>
#include <thread>

#include "base/cancellation.h"
#include "base/posix_file.h"
#include "cli/printing.h"

namespace raystage::cli {
namespace {

// A signal handler may only access static data: it writes the number to a pipe, and a thread
// requests the stop.
std::array<int, 2> signal_pipe{-1, -1};

void on_signal(int number) {
  const auto byte = static_cast<unsigned char>(number);
  [[maybe_unused]] const ssize_t written = write(signal_pipe[1], &byte, 1);
}

/// Prints what this program composes, with its own control characters.
void draw(const std::string& text) { std::fputs(text.c_str(), stderr); }

class SignalWatch {
 public:
  /// `on_stop`: called once, at the first signal, in a thread of its own.
  explicit SignalWatch(const std::function<void()>& on_stop) {
    if (pipe2(signal_pipe.data(), O_CLOEXEC) != 0) return;
    thread_ = std::thread([this, on_stop] {
      unsigned char number = 0;
      while (read(signal_pipe[0], &number, 1) == 1 && number != 0) {
        if (signal_.exchange(number) == 0) on_stop();
        source_.request_stop();
      }
    });
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);  // a file size limit becomes an error of write()
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

int run_command(std::string_view name, const CommandBody& body, OnSignal on_signal) {
  const auto complain = [&](std::string_view text) {
    print_error("raystage {}: {}\n", name, text);
    std::fflush(stderr);
  };
  // Frames of tens of megabytes are allocated often: keep their pages instead of faulting them in
  // again.
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the maximum of glibc
  raise_open_file_limit();
  SignalWatch watch([&] {
    if (on_signal == OnSignal::kAbort) complain("stopping");
  });
  int code = static_cast<int>(ExitCode::kFailed);
  try {
    code = static_cast<int>(body(watch.token()));
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
      throw Error::from_errno("the result cannot be written", "standard output",
                              "Check the output disk's free space, or what reads the output");
    }
  } catch (const Cancelled&) {
    code = static_cast<int>(ExitCode::kFailed);
  } catch (const Error& error) {
    if (watch.signal() == 0 || on_signal == OnSignal::kEnd) complain(error.what());
    code = static_cast<int>(error.exit_code());
  } catch (const std::bad_alloc&) {
    complain("out of memory. Use fewer threads or a smaller --memory.");
    code = kOutOfMemoryCode;
  } catch (const std::filesystem::filesystem_error& error) {
    complain(fmt::format("a file or folder cannot be examined: {}. Check its name and permissions.",
                         error.what()));
  } catch (const std::system_error& error) {  // from fmt, if it cannot print
    complain(fmt::format("{}. Check the free space of the output disk.", error.what()));
  } catch (const std::exception& error) {
    complain(fmt::format("unexpected: {}. Please report this.", error.what()));
  }
  if (watch.signal() != 0 && code != 0 && on_signal == OnSignal::kAbort) {
    complain("stopped; no partial files remain");
    return 128 + watch.signal();
  }
  return code;
}

constexpr auto kBetweenLines = std::chrono::milliseconds(500);

Progress::Progress(ProgressStyle style)
    : style_(style), bar_(style == ProgressStyle::kAuto && isatty(STDERR_FILENO) == 1) {}

void Progress::report(double done) {
  if (style_ == ProgressStyle::kNone) return;
  const int percent = std::clamp(static_cast<int>(done * 100), 0, 100);
  const std::scoped_lock lock(mutex_);
  if (percent <= percent_) return;
  percent_ = percent;
  if (bar_) {
    draw_bar();
    if (percent == 100) std::fputc('\n', stderr);
  } else if (style_ == ProgressStyle::kOpenJd) {
    print_error("openjd_progress: {}\n", percent);
  } else if (const auto now = std::chrono::steady_clock::now();
             percent == 100 || now - last_line_ >= kBetweenLines) {
    last_line_ = now;
    print_error("Progress: {}%\n", percent);
  }
  std::fflush(stderr);
}

void Progress::say(std::string_view line) {
  const std::scoped_lock lock(mutex_);
  const bool bar_open = bar_ && percent_ >= 0 && percent_ < 100;
  if (bar_open) draw(fmt::format("\r{: <60}\r", ""));
  print_error("{}\n", line);
  if (bar_open) draw_bar();
  std::fflush(stderr);
}

void Progress::draw_bar() const {
  constexpr int kWidth = 40;
  const int filled = percent_ * kWidth / 100;
  draw(fmt::format("\r[{:=<{}}{: <{}}] {:3}%", "", filled, "", kWidth - filled, percent_));
}

}  // namespace raystage::cli
