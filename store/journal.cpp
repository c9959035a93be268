// SPDX-License-Identifier: Apache-2.0
// Encodes and decodes the journal (docs/formats/journal.md): a header of 64 bytes and records of 48
// bytes, little-endian. The CRC-24 of OpenPGP (RFC 9580, section 6.1) of each record detects up to
// three flipped bits.
#include "store/journal.h"

#include <xxhash.h>

#include <algorithm>
#include <cassert>
#include <string>

#include "base/cancellation.h"
#include "base/error.h"
#include "base/little_endian.h"

namespace raystage::store::journal {
namespace {

constexpr std::array<char, 8> kMagic{'R', 'A', 'Y', 'S', 'J', 'R', 'N', 'L'};
constexpr std::size_t kVersionAt = 8, kRecordSizeAt = 12, kEpochAt = 16, kCameraAt = 24,
                      kHeaderCheckAt = 56;
constexpr std::size_t kTimeAt = 0, kOffsetAt = 8, kSizeAt = 16, kStatusAt = 20, kHashAt = 24,
                      kArrivalAt = 32, kSequenceAt = 40;
constexpr std::uint32_t kStatusMask = 0xFF;
constexpr auto kLastStatus = static_cast<std::uint32_t>(kFrameStatusCount - 1);
// On disk alone: stored, and is_unverified.
constexpr std::uint32_t kStoredUnverified = 10;
static_assert(kStoredUnverified >= kFrameStatusCount);

// CRC-24 of OpenPGP (RFC 9580, section 6.1): detects one, two or three flipped bits in a record.
constexpr std::uint32_t kCrcPolynomial = 0x864CFB, kCrcStart = 0xB704CE, kCrcTop = 0x800000;

constexpr std::array<std::uint32_t, 256> kCrcTable = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < table.size(); ++byte) {
    std::uint32_t crc = byte << 16;
    for (int bit = 0; bit < 8; ++bit) crc = (crc << 1) ^ ((crc & kCrcTop) ? kCrcPolynomial : 0);
    table[byte] = crc & 0xFFFFFF;
  }
  return table;
}();

std::uint32_t crc24(std::span<const std::byte> bytes) {
  std::uint32_t crc = kCrcStart;
  for (const std::byte byte : bytes) {
    const std::uint32_t index = (crc >> 16) ^ std::to_integer<std::uint32_t>(byte);
    crc = ((crc << 8) ^ kCrcTable[index & 0xFF]) & 0xFFFFFF;
  }
  return crc;
}

// Returns the 24-bit check of a record, computed with the check's own bits 0. A damaged record must
// not pass as another frame, and must not invalidate the rest of the journal.
std::uint32_t check_of(std::span<const std::byte> record) {
  std::array<std::byte, kRecordBytes> plain{};
  std::ranges::copy(record, plain.begin());
  std::fill_n(plain.begin() + kStatusAt + 1, 3, std::byte{0});
  const auto own = std::span(plain).first(record.size());
  if (record.size() == kRecordBytes) return crc24(own) << 8;
  return static_cast<std::uint32_t>(XXH3_64bits(own.data(), own.size())) & ~kStatusMask;
}

void encode_fields(std::span<std::byte> bytes, const FrameRecord& record) {
  store_little_endian(bytes, kTimeAt, record.time_ns);
  store_little_endian(bytes, kOffsetAt, record.offset);
  store_little_endian(bytes, kSizeAt, record.size);
  const bool is_unverified = record.status == FrameStatus::kStored && record.is_unverified;
  const auto status = is_unverified ? kStoredUnverified : static_cast<std::uint32_t>(record.status);
  store_little_endian(bytes, kStatusAt, status);
  store_little_endian(bytes, kHashAt, record.xxh3);
  if (bytes.size() == kRecordBytes) {
    store_little_endian(bytes, kArrivalAt, record.arrival_ns);
    store_little_endian(bytes, kSequenceAt, record.sequence);
  }
  store_little_endian(bytes, kStatusAt, status | check_of(bytes));
}

}  // namespace

std::size_t record_bytes(std::uint32_t version) {
  return version == 1 ? kRecordBytesV1 : kRecordBytes;
}

std::optional<FrameRecord> decode_record(std::span<const std::byte> bytes, std::uint32_t version) {
  assert(bytes.size() == record_bytes(version));
  const auto field = load_little_endian<std::uint32_t>(bytes, kStatusAt);
  const std::uint32_t status = field & kStatusMask;
  if ((field & ~kStatusMask) != check_of(bytes)) return std::nullopt;
  const bool is_unverified = version >= 2 && status == kStoredUnverified;
  if (status > kLastStatus && !is_unverified) return std::nullopt;
  FrameRecord record;
  record.is_unverified = is_unverified;
  record.time_ns = load_little_endian<std::int64_t>(bytes, kTimeAt);
  record.offset = load_little_endian<std::uint64_t>(bytes, kOffsetAt);
  record.size = load_little_endian<std::uint32_t>(bytes, kSizeAt);
  record.status = is_unverified ? FrameStatus::kStored : static_cast<FrameStatus>(status);
  record.xxh3 = load_little_endian<std::uint64_t>(bytes, kHashAt);
  if (version >= 2) {
    record.arrival_ns = load_little_endian<std::int64_t>(bytes, kArrivalAt);
    record.sequence = load_little_endian<std::uint64_t>(bytes, kSequenceAt);
  }
  return record;
}

std::uint64_t hash_camera_id(std::string_view camera_id) {
  return XXH3_64bits(camera_id.data(), camera_id.size());
}

std::array<std::byte, kHeaderBytes> encode_header(const ArchiveWriter::Description& description,
                                                  std::uint32_t version) {
  std::array<std::byte, kHeaderBytes> bytes{};
  std::ranges::copy(std::as_bytes(std::span(kMagic)), bytes.begin());
  store_little_endian(bytes, kVersionAt, version);
  store_little_endian(bytes, kRecordSizeAt, static_cast<std::uint32_t>(record_bytes(version)));
  store_little_endian(bytes, kEpochAt, description.epoch_utc);
  store_little_endian(bytes, kCameraAt, hash_camera_id(description.camera_id));
  store_little_endian(bytes, kHeaderCheckAt,
                      static_cast<std::uint64_t>(XXH3_64bits(bytes.data(), kHeaderCheckAt)));
  return bytes;
}

std::array<std::byte, kRecordBytes> encode_record(const FrameRecord& record) {
  std::array<std::byte, kRecordBytes> bytes{};
  encode_fields(bytes, record);
  return bytes;
}

std::array<std::byte, kRecordBytesV1> encode_record_v1(const FrameRecord& record) {
  std::array<std::byte, kRecordBytesV1> bytes{};
  encode_fields(bytes, record);
  return bytes;
}

void require_possible_size(std::uint64_t bytes, std::string_view name) {
  if (bytes <= kMaxBytes) return;
  throw Error::bad_input(
      "the journal has " + std::to_string(bytes) + " bytes, allowed: " + std::to_string(kMaxBytes),
      std::string(name),
      "Move it away; `raystage repair` then writes one from the archive, whose frames count as "
      "unverified");
}

std::optional<Header> decode_header(std::span<const std::byte> file, std::string_view name) {
  require_possible_size(file.size(), name);
  if (file.size() < kHeaderBytes) return std::nullopt;
  const auto header = file.first<kHeaderBytes>();
  const bool magic =
      std::ranges::equal(header.first<kMagic.size()>(), std::as_bytes(std::span(kMagic)));
  if (!magic || load_little_endian<std::uint64_t>(header, kHeaderCheckAt) !=
                    XXH3_64bits(header.data(), kHeaderCheckAt)) {
    return std::nullopt;
  }
  const auto version = load_little_endian<std::uint32_t>(header, kVersionAt);
  const auto record_size = load_little_endian<std::uint32_t>(header, kRecordSizeAt);
  if (version < 1 || version > kVersion || record_size != record_bytes(version)) {
    throw Error::bad_input(
        "the journal has format version " + std::to_string(version) + " with " +
            std::to_string(record_size) + " bytes per record; this program reads versions 1 to " +
            std::to_string(kVersion) + " with " + std::to_string(kRecordBytesV1) + " and " +
            std::to_string(kRecordBytes),
        std::string(name) + " @" + std::to_string(kVersionAt), "Use a newer Raystage");
  }
  return Header{version, load_little_endian<std::int64_t>(header, kEpochAt),
                load_little_endian<std::uint64_t>(header, kCameraAt)};
}

Contents decode(std::span<const std::byte> file, std::string_view name) {
  Contents contents;
  contents.header = decode_header(file, name);
  if (!contents.header) return contents;
  const std::uint32_t version = contents.header->version;
  const std::size_t step = record_bytes(version);
  auto rest = file.subspan(kHeaderBytes);
  constexpr std::size_t kAtOnce = std::size_t{1} << 20;  // records between two checks for a stop
  contents.records.reserve(std::min(rest.size() / step, kAtOnce));
  for (std::size_t i = 0; rest.size() >= step; rest = rest.subspan(step), ++i) {
    if (i % kAtOnce == 0) throw_if_cancelled();
    if (const auto record = decode_record(rest.first(step), version)) {
      contents.records.push_back(*record);
    } else {
      ++contents.damaged;
    }
  }
  contents.has_torn_end = !rest.empty();
  if (contents.has_torn_end) ++contents.damaged;
  return contents;
}

}  // namespace raystage::store::journal
