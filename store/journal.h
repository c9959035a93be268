// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "store/archive.h"

namespace raystage::journal {

// Layout: docs/formats/journal.md.
inline constexpr std::size_t kHeaderBytes = 64;
inline constexpr std::size_t kRecordBytes = 32;
inline constexpr std::uint32_t kVersion = 1;

std::array<std::byte, kHeaderBytes> encode_header(const ArchiveWriter::Description& description);
std::array<std::byte, kRecordBytes> encode_record(const FrameRecord& record);

/// What a journal file says, before it is held against its archive.
struct Contents {
  bool header_valid = false;
  Nanoseconds epoch_utc = 0;
  std::uint64_t camera_hash = 0;
  std::vector<FrameRecord> records;  ///< those whose own check holds, in file order
  std::size_t damaged = 0;           ///< records that failed it; a torn last one counts
};

/// Reads any bytes. A journal without a whole, intact header has no records. Throws Error (bad
/// input) only where the header is intact and of a future version.
Contents decode(std::span<const std::byte> file, std::string_view name);

/// What binds a journal to its archive, beside the epoch.
std::uint64_t hash_of_camera(std::string_view camera_id);

}  // namespace raystage::journal
