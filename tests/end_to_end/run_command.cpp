// SPDX-License-Identifier: Apache-2.0
#include "tests/end_to_end/run_command.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include "testing/test_data.h"
#include "testing/test_paths.h"
#include "testing/test_permissions.h"

namespace raystage::testing {
namespace {

/// Reads what a command writes to one of its streams while it runs. Uses a pipe, because a limit on
/// the size of files would also apply to a file.
class Stream {
 public:
  Stream() {
    if (pipe2(ends_.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  }
  /// Replaces the stream with this file descriptor. For the child.
  void connect(int number) const { dup2(ends_[1], number); }
  /// Starts the thread that reads. For the parent.
  void start_reading() {
    close(ends_[1]);
    reader_ = std::thread([this] {
      std::array<char, 4096> buffer{};
      ssize_t count = 0;
      while ((count = read(ends_[0], buffer.data(), buffer.size())) > 0) {
        text_.append(buffer.data(), static_cast<std::size_t>(count));
      }
      close(ends_[0]);
    });
  }
  std::string text() {
    reader_.join();
    return text_;
  }

 private:
  std::array<int, 2> ends_{};
  std::string text_;
  std::thread reader_;
};

struct Running {
  pid_t child = -1;
  Stream out, err;
};

void start(Running& running, const std::string& command, const CommandLimits& lacks) {
  const std::string whole =
      "export PATH='" + testing::commands_folder().string() + ":'\"$PATH\"; " + command;
  running.child = fork();
  if (running.child == 0) {
    setpgid(0, 0);
    running.out.connect(STDOUT_FILENO);
    running.err.connect(STDERR_FILENO);
    if (lacks.max_file_bytes) {
      // The lower of the two limits: decoders raise theirs, whose results are files in memory.
      rlimit limit{};
      if (getrlimit(RLIMIT_FSIZE, &limit) != 0) _exit(126);
      limit.rlim_cur = *lacks.max_file_bytes;
      if (setrlimit(RLIMIT_FSIZE, &limit) != 0) _exit(126);
#ifdef __SANITIZE_THREAD__
      signal(SIGXFSZ, SIG_IGN);  // the sanitizer's writes raise it before the command can ignore it
#endif
    }
    if (lacks.root && !testing::drop_root_privileges()) _exit(126);
    execl("/bin/bash", "bash", "-c", whole.c_str(), nullptr);
    _exit(127);
  }
  running.out.start_reading();
  running.err.start_reading();
}

CommandResult finish(Running& running) {
  CommandResult result;
  result.out = running.out.text();
  result.err = running.err.text();
  int status = 0;
  rusage used{};
  wait4(running.child, &status, 0, &used);
  result.peak_memory = static_cast<std::size_t>(used.ru_maxrss) * 1024;  // Linux counts in KiB
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

}  // namespace

CommandResult run(const std::string& command, const CommandLimits& lacks) {
  Running running;
  start(running, command, lacks);
  return finish(running);
}

CommandResult run_and_signal(const std::string& command, int signal,
                             const std::filesystem::path& ready) {
  Running running;
  start(running, "exec " + command, {});
  for (int waited = 0; waited < 12000 && !std::filesystem::exists(ready); ++waited) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  kill(running.child, signal);
  return finish(running);
}

std::optional<std::filesystem::path> find_captured_data(const std::string& set) {
  const std::filesystem::path folder = testing::test_data();
  if (!std::filesystem::exists(folder / set)) return std::nullopt;
  return folder / set;
}

std::vector<std::filesystem::path> find_files(const std::filesystem::path& folder,
                                              const std::string& part) {
  std::vector<std::filesystem::path> found;
  if (!std::filesystem::exists(folder)) return found;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().filename().string().find(part) != std::string::npos) {
      found.push_back(entry.path());
    }
  }
  return found;
}

std::map<std::string, std::string> read_folder(const std::filesystem::path& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    contents[entry.path().lexically_relative(folder).string()] =
        entry.is_directory() ? "folder" : read_text(entry.path());
  }
  return contents;
}

std::string read_text(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
    text.replace(at, from.size(), to);
    at += to.size();
  }
  return text;
}

}  // namespace raystage::testing
