// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdlib>
#include <span>

#include "store/archive_index.h"

namespace raystage {

/// Ends the process if a table lists frames that its archive does not contain.
inline void check_index(const store::ArchiveIndex& index, std::span<const std::byte> archive) {
  Nanoseconds last = 0, last_stored = -1;
  std::size_t end = 0, stored = 0;
  for (const store::FrameRecord& record : index.records) {
    if (record.time_ns < last) std::abort();
    last = record.time_ns;
    if (record.status != store::FrameStatus::kStored) continue;
    if (record.time_ns <= last_stored) std::abort();
    last_stored = record.time_ns;
    if (stored >= index.frames.size() || !(index.frames[stored++] == record)) std::abort();
    if (record.size == 0 || record.offset < end || record.offset > archive.size() ||
        record.size > archive.size() - record.offset) {
      std::abort();
    }
    end = static_cast<std::size_t>(record.offset) + record.size;
  }
  if (stored != index.frames.size()) std::abort();
}

}  // namespace raystage
