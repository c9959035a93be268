// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/posix_file.h"
#include "store/archive.h"

namespace raystage::store {

/// Reads the frames of an archive as they are stored, where ArchiveReader returns their JPEGs:
/// packed frames stay packed. For copies of an archive. Const members are thread-safe.
class StoredFrames {
 public:
  /// Throws Error (bad input) if the file cannot be read.
  explicit StoredFrames(std::filesystem::path archive);

  /// Returns the bytes of a stored frame of the archive. Throws Error (bad input) if they cannot be
  /// read, or do not have the XXH3 of their record (0: it has none).
  FrameBytes read(const FrameRecord& record) const;

 private:
  std::filesystem::path path_;
  InputFile file_;
};

}  // namespace raystage::store
