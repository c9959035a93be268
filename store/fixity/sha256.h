// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "base/contained_path.h"

namespace raystage::store {

/// Computes the SHA-256 (FIPS 180-4) of bytes that come in parts.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void update(std::span<const std::byte> bytes);
  /// Returns 64 lower-case hexadecimal digits. Ends the computation.
  std::string hex();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Returns the SHA-256 of a regular file, without following links. `on_bytes`: called with the
/// number of bytes of each part that was read; returns false to stop, the result is "" then. Throws
/// Error (bad input) if the file is missing or not a regular one, Error (failed) if the disk cannot
/// read it.
std::string sha256_of_file(const ContainedPath& file,
                           const std::function<bool(std::size_t)>& on_bytes);

}  // namespace raystage::store
