// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "store/temporal/temporal_frame.h"

namespace raystage::store {

/// Decodes groups of temporal frames. FFmpeg runs in processes of its own (sandbox/), as many as
/// threads call at once; they start with the first call. Thread-safe.
class GroupDecoder {
 public:
  /// Of a camera, pixels. Other pictures are not accepted.
  struct Size {
    int width = 0, height = 0;
  };

  GroupDecoder();
  ~GroupDecoder();
  GroupDecoder(GroupDecoder&&) noexcept;
  GroupDecoder& operator=(GroupDecoder&&) noexcept;

  /// Returns the pictures of the first frames of a group, in order, each as a JPEG of the decoded
  /// planes at quantiser step 1 (docs/formats/archive.md). `file`: for errors. Throws Error (bad
  /// input) if FFmpeg cannot decode them to pictures of this size, and Error (failed) if it cannot
  /// be run.
  std::vector<std::vector<std::byte>> decode(VideoCodec codec, Size size,
                                             std::span<const std::span<const std::byte>> frames,
                                             const std::filesystem::path& file) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::store
