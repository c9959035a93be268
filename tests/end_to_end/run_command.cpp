// SPDX-License-Identifier: Apache-2.0
#include "tests/end_to_end/run_command.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <thread>

#include "schemas/test_folder.h"

namespace raystage::testing {
namespace {

pid_t start(const std::string& command, const std::filesystem::path& folder) {
  const std::string whole = "export PATH='" RAYSTAGE_BIN_DIR ":'\"$PATH\"; exec >'" +
                            (folder / "out").string() + "' 2>'" + (folder / "err").string() +
                            "'; " + command;
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    execl("/bin/bash", "bash", "-c", whole.c_str(), nullptr);
    _exit(127);
  }
  return child;
}

CommandResult finish(pid_t child, const std::filesystem::path& folder) {
  int status = 0;
  waitpid(child, &status, 0);
  CommandResult result;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = text_of(folder / "out");
  result.err = text_of(folder / "err");
  return result;
}

}  // namespace

CommandResult run(const std::string& command) {
  const TestFolder folder;
  return finish(start(command, folder.path()), folder.path());
}

CommandResult run_and_signal(const std::string& command, int signal,
                             const std::filesystem::path& ready) {
  const TestFolder folder;
  const pid_t child = start("exec " + command, folder.path());
  for (int waited = 0; waited < 12000 && !std::filesystem::exists(ready); ++waited) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  kill(child, signal);
  return finish(child, folder.path());
}

std::optional<std::filesystem::path> captured_data(const std::string& set) {
  const char* given = std::getenv("RAYSTAGE_DATA");
  const std::filesystem::path folder =
      given != nullptr ? std::filesystem::path(given)
                       : std::filesystem::path(RAYSTAGE_SOURCE_DIR) / ".." / "shared" / "data";
  if (!std::filesystem::exists(folder / set)) return std::nullopt;
  return folder / set;
}

std::vector<std::filesystem::path> files_with(const std::filesystem::path& folder,
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

std::string text_of(const std::filesystem::path& file) {
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
