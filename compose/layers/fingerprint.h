// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace raystage::compose {

/// Hashes everything that determines the contents of a file into one XXH3-128. Each value is hashed
/// with a label and its length, so that adjacent values cannot be confused.
class Fingerprint {
 public:
  Fingerprint();
  ~Fingerprint();
  Fingerprint(const Fingerprint& other);
  Fingerprint& operator=(const Fingerprint&) = delete;

  Fingerprint& text(std::string_view label, std::string_view value);
  Fingerprint& integer(std::string_view label, std::int64_t value);
  /// Hashes the bits of the value; -0 counts as 0.
  Fingerprint& number(std::string_view label, double value);
  /// Returns 32 hex digits.
  std::string hex() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::compose
