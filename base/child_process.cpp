// SPDX-License-Identifier: Apache-2.0
#include "base/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/stopwatch.h"

extern char** environ;  // NOLINT: POSIX's name

namespace raystage {
namespace {

constexpr std::size_t kLongestLine = std::size_t{1} << 20;
constexpr int kPollMs = 50;

class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  int number() const { return number_; }
  void close() {
    if (number_ >= 0) ::close(std::exchange(number_, -1));
  }

 private:
  int number_;
};

struct Pipe {
  Descriptor read, write;
};

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw Error::from_errno("no pipe for the output of a program could be opened", "",
                            "Close other programs and try again");
  }
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

pid_t start(const std::vector<std::string>& command, int in, int out) {
  std::vector<char*> arguments;
  for (const std::string& word : command) {
    arguments.push_back(const_cast<char*>(word.c_str()));  // NOLINT: posix_spawn writes to none
  }
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, out, STDERR_FILENO);
  // The child must not inherit that this program ignores these signals.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t defaults;
  sigemptyset(&defaults);
  sigaddset(&defaults, SIGPIPE);
  sigaddset(&defaults, SIGXFSZ);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  pid_t child = -1;
  const int error =
      posix_spawnp(&child, arguments[0], &actions, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) {
    errno = error;
    throw Error::from_errno("the program cannot be started", command.front(),
                            "Install it, or add its folder to the PATH");
  }
  return child;
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * time.tv_usec;
}

/// Splits a stream into lines.
class Lines {
 public:
  explicit Lines(const std::function<void(std::string_view)>& line) : line_(line) {}
  void add(std::string_view text) {
    for (const char c : text) {
      if (c == '\n' || c == '\r') {
        flush();
      } else if (rest_.size() < kLongestLine) {
        rest_ += c;
      }
    }
  }
  void flush() {
    if (!rest_.empty()) line_(rest_);
    rest_.clear();
  }

 private:
  const std::function<void(std::string_view)>& line_;
  std::string rest_;
};

/// Returns the descriptor of a file to which text is appended; -1 without a name. A link, which
/// could lead anywhere, and a pipe that nobody reads are not opened.
int open_log(const std::filesystem::path& file) {
  if (file.empty()) return -1;
  const int log =
      open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
  struct stat status {};
  if (log < 0 || (fstat(log, &status) == 0 && S_ISREG(status.st_mode))) return log;
  close(log);
  return -1;
}

}  // namespace

ChildResult run_child(const std::vector<std::string>& command, const ChildOptions& options) {
  Pipe out = make_pipe(), in = make_pipe();
  const Stopwatch watch;
  const pid_t child = start(command, in.read.number(), out.write.number());
  out.write.close();
  in.read.close();
  const Descriptor log(open_log(options.log));
  // Input has its own thread, because the child may print before it has read all of it.
  std::thread feeder([input = options.input, end = std::move(in.write)]() mutable {
    // A program that ends before it has read its input must not end this one.
    sigset_t broken_pipe;
    sigemptyset(&broken_pipe);
    sigaddset(&broken_pipe, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &broken_pipe, nullptr);
    std::size_t done = 0;
    while (done < input.size()) {
      const ssize_t written = write(end.number(), input.data() + done, input.size() - done);
      if (written <= 0) break;
      done += static_cast<std::size_t>(written);
    }
    end.close();
  });
  ChildResult result;
  Lines lines(options.line);
  bool terminated = false, open_stream = true, ended = false;
  int status = 0;
  rusage used{};
  while (open_stream || !ended) {
    if (options.stop.stop_requested() && !terminated) {
      kill(child, SIGTERM);
      terminated = true;
    }
    if (options.timeout_seconds > 0 && watch.seconds() > options.timeout_seconds &&
        !result.timed_out) {
      kill(child, SIGKILL);
      result.timed_out = true;
    }
    pollfd poll_for{out.read.number(), POLLIN, 0};
    if (open_stream && poll(&poll_for, 1, kPollMs) > 0) {
      std::array<char, 16384> buffer{};
      const ssize_t got = read(out.read.number(), buffer.data(), buffer.size());
      if (got > 0) {
        const std::string_view text(buffer.data(), static_cast<std::size_t>(got));
        if (log.number() >= 0) {
          [[maybe_unused]] const ssize_t kept = write(log.number(), text.data(), text.size());
        }
        result.out.append(text.substr(
            0, options.max_output_bytes - std::min(options.max_output_bytes, result.out.size())));
        lines.add(text);
        continue;
      }
      open_stream = got < 0 && errno == EINTR;
    }
    if (!ended) ended = wait4(child, &status, open_stream ? WNOHANG : 0, &used) == child;
    // Do not wait for a grandchild that outlives the child and keeps the stream open.
    if (ended && open_stream && poll(&poll_for, 1, 0) <= 0) open_stream = false;
  }
  lines.flush();
  feeder.join();
  result.wall_seconds = watch.seconds();
  result.cpu_seconds = seconds(used.ru_utime) + seconds(used.ru_stime);
  result.peak_memory_bytes = static_cast<double>(used.ru_maxrss) * 1024;  // Linux counts in KiB
  result.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + result.signal;
  return result;
}

std::filesystem::path sibling_program(std::string_view name) {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path() / name;
}

}  // namespace raystage
