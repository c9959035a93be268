// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <mutex>
#include <span>
#include <vector>

#include "sandbox/decoder_process.h"

namespace raystage::sandbox {

/// Processes of one decoder: as many as threads decode at once. For requests that do not depend on
/// earlier ones. Thread-safe.
class DecoderPool {
 public:
  explicit DecoderPool(DecoderOptions options);

  /// As DecoderProcess::decode(), in a process that is idle, or else in a new one.
  std::vector<std::byte> decode(std::span<const std::byte> request,
                                const std::filesystem::path& file, const OpenFile& open_file) const;

 private:
  DecoderOptions options_;
  mutable std::mutex mutex_;
  mutable std::vector<DecoderProcess> idle_;
};

}  // namespace raystage::sandbox
