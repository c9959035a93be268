// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <string>
#include <string_view>

namespace raystage {

/// What a process tells its caller (docs/render-process.md).
enum class ExitCode : int { kSuccess = 0, kFailed = 1, kBadInput = 2, kSomeFramesFailed = 3 };

/// The one exception for what a user can mend: what happened, in which file (and where in it), and
/// what to do about it. Broken invariants are assertions, not Errors.
class Error : public std::exception {
 public:
  /// The arguments, the documents or the data handed in are unusable: exit code 2.
  static Error bad_input(std::string what_happened, std::string where, std::string what_to_do);
  /// The run failed on good input (disk full, permission, lost file): exit code 1.
  static Error failed(std::string what_happened, std::string where, std::string what_to_do);
  /// As failed(), with the text of the current errno appended to `what_happened`.
  static Error from_errno(std::string_view what_happened, std::string where,
                          std::string what_to_do);

  /// "where: what happened. What to do." on one line.
  const char* what() const noexcept override { return message_.c_str(); }
  const std::string& what_happened() const { return what_happened_; }
  /// A path, with "#/json/pointer" or "@byte offset" where that is known. May be empty.
  const std::string& where() const { return where_; }
  const std::string& what_to_do() const { return what_to_do_; }
  ExitCode exit_code() const { return exit_code_; }

 private:
  Error(ExitCode exit_code, std::string what_happened, std::string where, std::string what_to_do);

  ExitCode exit_code_;
  std::string what_happened_, where_, what_to_do_, message_;
};

}  // namespace raystage
