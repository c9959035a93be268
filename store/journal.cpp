// SPDX-License-Identifier: Apache-2.0
#include "store/journal.h"

#include <xxhash.h>

#include <algorithm>
#include <string>

#include "schemas/error.h"
#include "store/little_endian.h"

namespace raystage::journal {
namespace {

constexpr std::array<char, 8> kMagic{'R', 'A', 'Y', 'S', 'J', 'R', 'N', 'L'};
constexpr std::size_t kVersionAt = 8, kRecordSizeAt = 12, kEpochAt = 16, kCameraAt = 24,
                      kHeaderCheckAt = 56;
constexpr std::size_t kTimeAt = 0, kOffsetAt = 8, kSizeAt = 16, kStatusAt = 20, kHashAt = 24;
constexpr std::uint32_t kStatusMask = 0xFF;
constexpr auto kLastStatus = static_cast<std::uint32_t>(FrameStatus::kStartUp);

// 24 bits over the record with the check's own bits 0: one rotten record must not pass for another
// frame, and must not take the rest of the journal with it.
std::uint32_t check_of(std::span<const std::byte, kRecordBytes> record) {
  std::array<std::byte, kRecordBytes> plain{};
  std::ranges::copy(record, plain.begin());
  std::fill_n(plain.begin() + kStatusAt + 1, 3, std::byte{0});
  return static_cast<std::uint32_t>(XXH3_64bits(plain.data(), plain.size())) & ~kStatusMask;
}

std::optional<FrameRecord> decode_record(std::span<const std::byte, kRecordBytes> bytes) {
  const auto status = load_little_endian<std::uint32_t>(bytes, kStatusAt);
  if ((status & ~kStatusMask) != check_of(bytes) || (status & kStatusMask) > kLastStatus) {
    return std::nullopt;
  }
  FrameRecord record;
  record.time_ns = load_little_endian<std::int64_t>(bytes, kTimeAt);
  record.offset = load_little_endian<std::uint64_t>(bytes, kOffsetAt);
  record.size = load_little_endian<std::uint32_t>(bytes, kSizeAt);
  record.status = static_cast<FrameStatus>(status & kStatusMask);
  record.xxh3 = load_little_endian<std::uint64_t>(bytes, kHashAt);
  return record;
}

}  // namespace

std::uint64_t hash_of_camera(std::string_view camera_id) {
  return XXH3_64bits(camera_id.data(), camera_id.size());
}

std::array<std::byte, kHeaderBytes> encode_header(const ArchiveWriter::Description& description) {
  std::array<std::byte, kHeaderBytes> bytes{};
  std::ranges::copy(std::as_bytes(std::span(kMagic)), bytes.begin());
  store_little_endian(bytes, kVersionAt, kVersion);
  store_little_endian(bytes, kRecordSizeAt, static_cast<std::uint32_t>(kRecordBytes));
  store_little_endian(bytes, kEpochAt, description.epoch_utc);
  store_little_endian(bytes, kCameraAt, hash_of_camera(description.camera_id));
  store_little_endian(bytes, kHeaderCheckAt,
                      static_cast<std::uint64_t>(XXH3_64bits(bytes.data(), kHeaderCheckAt)));
  return bytes;
}

std::array<std::byte, kRecordBytes> encode_record(const FrameRecord& record) {
  std::array<std::byte, kRecordBytes> bytes{};
  store_little_endian(bytes, kTimeAt, record.time_ns);
  store_little_endian(bytes, kOffsetAt, record.offset);
  store_little_endian(bytes, kSizeAt, record.size);
  const auto status = static_cast<std::uint32_t>(record.status);
  store_little_endian(bytes, kStatusAt, status);
  store_little_endian(bytes, kHashAt, record.xxh3);
  store_little_endian(bytes, kStatusAt, status | check_of(bytes));
  return bytes;
}

Contents decode(std::span<const std::byte> file, std::string_view name) {
  Contents contents;
  if (file.size() < kHeaderBytes) return contents;
  const auto header = file.first<kHeaderBytes>();
  const bool magic =
      std::ranges::equal(header.first<kMagic.size()>(), std::as_bytes(std::span(kMagic)));
  if (!magic || load_little_endian<std::uint64_t>(header, kHeaderCheckAt) !=
                    XXH3_64bits(header.data(), kHeaderCheckAt)) {
    return contents;
  }
  const auto version = load_little_endian<std::uint32_t>(header, kVersionAt);
  const auto record_size = load_little_endian<std::uint32_t>(header, kRecordSizeAt);
  if (version != kVersion || record_size != kRecordBytes) {
    throw Error::bad_input(
        "the journal has format version " + std::to_string(version) + " with " +
            std::to_string(record_size) + " bytes a record, this program reads version " +
            std::to_string(kVersion) + " with " + std::to_string(kRecordBytes),
        std::string(name) + " @" + std::to_string(kVersionAt), "Use a newer Raystage");
  }
  contents.header_valid = true;
  contents.epoch_utc = load_little_endian<std::int64_t>(header, kEpochAt);
  contents.camera_hash = load_little_endian<std::uint64_t>(header, kCameraAt);
  auto rest = file.subspan(kHeaderBytes);
  contents.records.reserve(rest.size() / kRecordBytes);
  for (; rest.size() >= kRecordBytes; rest = rest.subspan(kRecordBytes)) {
    if (const auto record = decode_record(rest.first<kRecordBytes>())) {
      contents.records.push_back(*record);
    } else {
      ++contents.damaged;
    }
  }
  if (!rest.empty()) ++contents.damaged;
  return contents;
}

}  // namespace raystage::journal
