// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <string>
#include <string_view>
#include <vector>

namespace raystage {

/// Exit code of a process (docs/render-process.md).
enum class ExitCode : int {
  kSuccess = 0,
  kFailed = 1,
  kBadInput = 2,
  kSomeFramesFailed = 3,
  /// Every frame is complete, but some show too much that no camera saw, or lack cameras whose
  /// stored frames are not as they were recorded.
  kFellShort = 4
};

/// The exception for everything that a user can correct: what failed, in which file (and where in
/// it), and what to do. Broken invariants are assertions, not Errors.
class Error : public std::exception {
 public:
  /// Returns an Error for unusable arguments, documents or data: exit code 2.
  static Error bad_input(std::string what_happened, std::string where, std::string what_to_do);
  /// Returns an Error for a run that failed with good input (disk full, permission, lost file):
  /// exit code 1.
  static Error failed(std::string what_happened, std::string where, std::string what_to_do);
  /// Returns failed() with the text of the current errno appended to `what_happened`.
  static Error from_errno(std::string_view what_happened, std::string where,
                          std::string what_to_do);

  /// Returns a copy that names the settings which the advice concerns, such as "focal_depth". A
  /// user interface can then add how they are set.
  Error concerning(std::vector<std::string> settings) const;

  /// Returns "where: what happened. What to do." on one line.
  const char* what() const noexcept override { return message_.c_str(); }
  const std::string& what_happened() const { return what_happened_; }
  /// Returns a path, with "#/json/pointer" or "@byte offset" if known. May be empty.
  const std::string& where() const { return where_; }
  const std::string& what_to_do() const { return what_to_do_; }
  const std::vector<std::string>& settings() const { return settings_; }
  ExitCode exit_code() const { return exit_code_; }

 private:
  Error(ExitCode exit_code, std::string what_happened, std::string where, std::string what_to_do);

  ExitCode exit_code_;
  std::string what_happened_, where_, what_to_do_, message_;
  std::vector<std::string> settings_;
};

}  // namespace raystage
