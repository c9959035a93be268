// SPDX-License-Identifier: Apache-2.0
#include "base/error.h"

#include <cerrno>
#include <cstddef>
#include <system_error>
#include <utility>

namespace raystage {

Error::Error(ExitCode exit_code, std::string what_happened, std::string where,
             std::string what_to_do)
    : exit_code_(exit_code),
      what_happened_(std::move(what_happened)),
      where_(std::move(where)),
      what_to_do_(std::move(what_to_do)) {
  if (!where_.empty()) message_ = where_ + ": ";
  message_ += what_happened_ + ".";
  if (!what_to_do_.empty()) message_ += " " + what_to_do_ + ".";
  // what() would end there.
  for (std::size_t nul = message_.find('\0'); nul != message_.npos; nul = message_.find('\0')) {
    message_.replace(nul, 1, "\\u0000");
  }
}

Error Error::concerning(std::vector<std::string> settings) const {
  Error result = *this;
  result.settings_ = std::move(settings);
  return result;
}

Error Error::bad_input(std::string what_happened, std::string where, std::string what_to_do) {
  return {ExitCode::kBadInput, std::move(what_happened), std::move(where), std::move(what_to_do)};
}

Error Error::failed(std::string what_happened, std::string where, std::string what_to_do) {
  return {ExitCode::kFailed, std::move(what_happened), std::move(where), std::move(what_to_do)};
}

Error Error::from_errno(std::string_view what_happened, std::string where, std::string what_to_do) {
  const std::string reason = std::generic_category().message(errno);
  return failed(std::string(what_happened) + ": " + reason, std::move(where),
                std::move(what_to_do));
}

}  // namespace raystage
