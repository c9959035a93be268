// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/contained_path.h"

namespace raystage::store {

/// The message digests of bags. MD5 and SHA-1 are read in bags of others and never written.
enum class DigestAlgorithm { kMd5, kSha1, kSha224, kSha256, kSha384, kSha512 };

/// Returns the algorithm of a manifest's file name, such as "sha256", in any case and with or
/// without '-'; nullopt if it is unknown.
std::optional<DigestAlgorithm> digest_algorithm(std::string_view name);
/// Returns "sha256".
std::string_view digest_name(DigestAlgorithm algorithm);
/// Returns the number of hexadecimal digits of a digest.
std::size_t digest_digits(DigestAlgorithm algorithm);

/// Computes several digests of the same bytes, which come in parts.
class Digests {
 public:
  explicit Digests(std::span<const DigestAlgorithm> algorithms);
  ~Digests();
  Digests(const Digests&) = delete;
  Digests& operator=(const Digests&) = delete;

  void update(std::span<const std::byte> bytes);
  /// Returns lower-case hexadecimal digits of each, in the order of the algorithms. Ends the
  /// computation.
  std::vector<std::string> hex();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Reads a regular file from start to end in parts of at most 1 MiB, without following links.
/// `on_part` returns false to stop. Returns false if it did. Throws Error (bad input) if the file
/// is missing or not a regular one, Error (failed) if the disk cannot read it.
bool read_in_parts(const ContainedPath& file,
                   const std::function<bool(std::span<const std::byte>)>& on_part);

}  // namespace raystage::store
