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
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::size_t kHeaderBytes = 64;
inline constexpr std::size_t kRecordBytes = 48, kRecordBytesV1 = 32;

/// Bytes of a record; `version` is 1 or 2.
std::size_t record_bytes(std::uint32_t version);

std::array<std::byte, kHeaderBytes> encode_header(const ArchiveWriter::Description& description,
                                                  std::uint32_t version = kVersion);
std::array<std::byte, kRecordBytes> encode_record(const FrameRecord& record);
/// Without arrival and sequence number.
std::array<std::byte, kRecordBytesV1> encode_record_v1(const FrameRecord& record);

struct Header {
  std::uint32_t version = kVersion;
  Nanoseconds epoch_utc = 0;
  std::uint64_t camera_hash = 0;  ///< see hash_of_camera
};
/// nullopt where the header is not whole and intact. Throws Error (bad input) where it is, and of a
/// future version; `name` stands for the file.
std::optional<Header> decode_header(std::span<const std::byte> file, std::string_view name);
/// `bytes` are a record's of that version; nullopt where its check fails. In version 2 no single
/// flipped bit passes.
std::optional<FrameRecord> decode_record(std::span<const std::byte> bytes, std::uint32_t version);

/// What a journal file says, before it is held against its archive.
struct Contents {
  std::optional<Header> header;
  std::vector<FrameRecord> records;  ///< those whose own check holds, in file order
  std::size_t damaged = 0;           ///< records that failed it; a torn last one counts
};

/// Reads any bytes. A journal without a whole, intact header has no records. Throws Error (bad
/// input) only where the header is intact and of a future version.
Contents decode(std::span<const std::byte> file, std::string_view name);

/// What binds a journal to its archive, beside the epoch.
std::uint64_t hash_of_camera(std::string_view camera_id);

}  // namespace raystage::journal
