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

namespace raystage::store::journal {

// Layout: docs/formats/journal.md.
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::size_t kHeaderBytes = 64;
inline constexpr std::size_t kRecordBytes = 48, kRecordBytesV1 = 32;

/// Frames at the end of an archive that was not closed that may lack their records and still count
/// as recorded: what an interrupted write leaves. More may be the remains of a power loss, and
/// nothing shows whether their bytes are the recorded ones.
inline constexpr int kMaxTrustedUnlistedFrames = 1;

/// Larger journals are refused: 89 million frames are a month at 30 a second.
inline constexpr std::uint64_t kMaxBytes = std::uint64_t{4} << 30;

/// Throws Error (bad input) for a journal larger than kMaxBytes; `name` is the file for errors.
void require_possible_size(std::uint64_t bytes, std::string_view name);

/// Returns the bytes per record; `version` is 1 or 2.
std::size_t record_bytes(std::uint32_t version);

std::array<std::byte, kHeaderBytes> encode_header(const ArchiveWriter::Description& description,
                                                  std::uint32_t version = kVersion);
std::array<std::byte, kRecordBytes> encode_record(const FrameRecord& record);
/// Returns a record of version 1, without arrival time and sequence number.
std::array<std::byte, kRecordBytesV1> encode_record_v1(const FrameRecord& record);

struct Header {
  std::uint32_t version = kVersion;
  Nanoseconds epoch_utc = 0;
  std::uint64_t camera_hash = 0;  ///< see hash_camera_id
};
/// Returns the header, or nullopt if it is truncated or damaged. Throws Error (bad input) if it is
/// intact but of a future version, and as require_possible_size(); `name` is the file for errors.
std::optional<Header> decode_header(std::span<const std::byte> file, std::string_view name);
/// Returns the record in `bytes`, a record of that version, or nullopt if its check fails. In
/// version 2 the check detects every single flipped bit.
std::optional<FrameRecord> decode_record(std::span<const std::byte> bytes, std::uint32_t version);

/// The contents of a journal file, not yet compared with its archive.
struct Contents {
  std::optional<Header> header;
  std::vector<FrameRecord> records;  ///< those that pass their check, in file order
  std::size_t damaged = 0;           ///< records that failed it or are truncated
  bool has_torn_end = false;         ///< the last one is truncated
};

/// Returns the contents of a journal; accepts any bytes. A journal without an intact header has no
/// records. Throws as decode_header(), and Cancelled (base/cancellation.h).
Contents decode(std::span<const std::byte> file, std::string_view name);

/// Returns the hash that, together with the epoch, links a journal to its archive.
std::uint64_t hash_camera_id(std::string_view camera_id);

}  // namespace raystage::store::journal
