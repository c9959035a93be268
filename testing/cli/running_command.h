// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "testing/test_paths.h"

namespace raystage::testing {

/// The words of a command: its program, e.g. "raystage-pack", and arguments.
using CommandWords = std::vector<std::string>;

/// A command in a process of its own, whose output is dropped. The destructor kills it.
class RunningCommand {
 public:
  /// Throws std::runtime_error if the program cannot be started.
  explicit RunningCommand(CommandWords words) {
    words.at(0) = (commands_folder() / words[0]).string();
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) {
      posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_WRONLY, 0);
    }
    const int error = posix_spawn(&child_, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot start " + words[0]);
  }
  ~RunningCommand() { end_by(SIGKILL); }
  RunningCommand(const RunningCommand&) = delete;
  RunningCommand& operator=(const RunningCommand&) = delete;

  bool has_ended() {
    if (child_ > 0 && waitpid(child_, &status_, WNOHANG) == child_) child_ = 0;
    return child_ == 0;
  }
  /// Waits for the end; returns the status as waitpid() states it.
  int wait() {
    if (child_ > 0) waitpid(std::exchange(child_, 0), &status_, 0);
    return status_;
  }
  /// Sends a signal if it still runs, and waits.
  int end_by(int signal) {
    if (child_ > 0) kill(child_, signal);
    return wait();
  }

 private:
  pid_t child_ = 0;
  int status_ = 0;
};

/// Kills a command (SIGKILL) at `moments` moments that are spread evenly over its run. The length
/// of a run is measured first. Calls `after_run` after each run that was not killed, with its exit
/// code, and `after_kill` after each that was: both make the command possible again. Ends early at
/// a fatal failure.
inline void kill_throughout(const CommandWords& words, int moments,
                            const std::function<void(int)>& after_run,
                            const std::function<void()>& after_kill) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  const int status = RunningCommand(words).wait();
  auto length = Clock::now() - begin;
  after_run(WIFEXITED(status) ? WEXITSTATUS(status) : -1);
  for (int moment = 0; moment < moments && !::testing::Test::HasFatalFailure();) {
    RunningCommand command(words);
    std::this_thread::sleep_for(length * (2 * moment + 1) / (2 * moments));
    const int ended = command.end_by(SIGKILL);
    if (WIFSIGNALED(ended)) {
      after_kill();
      ++moment;
    } else {  // this run was shorter: the same moment again
      after_run(WEXITSTATUS(ended));
      length = length * 9 / 10;
    }
  }
}

}  // namespace raystage::testing
