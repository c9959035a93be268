// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace raystage::testing {

struct CommandResult {
  int exit_code = -1;  ///< 128 + n if signal n ended it
  std::string out, err;
  std::size_t peak_memory = 0;  ///< bytes resident, of the largest of its processes
};

/// Limits for a command.
struct CommandLimits {
  /// No file grows beyond this, as on a full disk.
  std::optional<std::uint64_t> max_file_bytes = {};
  bool root = false;  ///< true: it runs as another user
};

/// Runs a shell command to its end, with the built executables first on the PATH.
CommandResult run(const std::string& command, const CommandLimits& lacks = {});

/// Starts a shell command, sends `signal` as soon as `ready` exists, and waits for its end.
CommandResult run_and_signal(const std::string& command, int signal,
                             const std::filesystem::path& ready);

/// Returns the folder of the captured light fields, or nullopt.
std::optional<std::filesystem::path> find_captured_data(const std::string& set);

/// Returns the files below a folder whose name contains `part`.
std::vector<std::filesystem::path> find_files(const std::filesystem::path& folder,
                                              const std::string& part);

/// Returns the contents of a folder by relative path: the text of a file, "folder" for a folder.
std::map<std::string, std::string> read_folder(const std::filesystem::path& folder);

std::string read_text(const std::filesystem::path& file);
void write_text(const std::filesystem::path& file, const std::string& text);

/// Returns `text` with every occurrence of `from` replaced.
std::string replaced(std::string text, const std::string& from, const std::string& to);

}  // namespace raystage::testing
