// SPDX-License-Identifier: Apache-2.0
// For tests: another program.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <string>

namespace raystage::testing {

/// A program that runs during the test and is killed at its end.
class TestProgram {
 public:
  explicit TestProgram(const std::string& command) {
    child_ = fork();
    if (child_ == 0) {
      setpgid(0, 0);  // so that its child processes are killed too
      execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
      _exit(127);
    }
  }
  ~TestProgram() { stop(); }
  TestProgram(const TestProgram&) = delete;
  TestProgram& operator=(const TestProgram&) = delete;
  void stop() {
    if (child_ <= 0) return;
    setpgid(child_, child_);  // whichever process runs first
    kill(-child_, SIGKILL);
    waitpid(child_, nullptr, 0);
    child_ = -1;
  }

 private:
  pid_t child_ = -1;
};

}  // namespace raystage::testing
