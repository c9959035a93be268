// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/archive.h"

namespace raystage::store {

/// Returns whether a stored frame of an archive is beyond the archive's end: it was lost after the
/// archive had been closed (ArchiveIndex::lost). Reads nothing. False for archives on other hosts.
inline bool is_lost(const ArchiveReader& archive, const FrameRecord& frame) {
  const std::uint64_t end = archive.bytes();
  return !archive.is_remote() && (frame.offset > end || frame.size > end - frame.offset);
}

}  // namespace raystage::store
