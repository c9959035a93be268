// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as the journal of an intact archive. If the first byte is odd, the rest are
// fields of records, which get valid checksums so that the code after the checks is reached. Its
// next bit selects the version.
#include <cstdint>
#include <vector>

#include "archive_invariants.h"
#include "base/error.h"
#include "base/little_endian.h"
#include "store/journal.h"
#include "store/matroska.h"

namespace {

using namespace raystage;
using Bytes = std::vector<std::byte>;

constexpr std::size_t kFrameBytes = 20;

store::ArchiveWriter::Description description() { return {"c0", 8, 8, 0}; }

template <typename Range>
void append(Bytes& bytes, const Range& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

Bytes make_archive() {
  Bytes bytes = store::matroska::make_header(description()).bytes;
  for (int i = 0; i < 4; ++i) {
    append(bytes, store::matroska::make_cluster_header(10 * (i + 1), kFrameBytes));
    bytes.resize(bytes.size() + kFrameBytes, static_cast<std::byte>(i));
  }
  return bytes;
}

Bytes seal(std::span<const std::byte> fields, std::uint32_t version) {
  Bytes bytes;
  append(bytes, store::journal::encode_header(description(), version));
  for (; fields.size() >= 12; fields = fields.subspan(12)) {
    store::FrameRecord record;
    record.time_ns = load_little_endian<std::int16_t>(fields, 0);
    record.offset = load_little_endian<std::uint16_t>(fields, 2);
    record.size = load_little_endian<std::uint16_t>(fields, 4);
    record.status =
        static_cast<store::FrameStatus>(load_little_endian<std::uint8_t>(fields, 6) % 10);
    record.is_unverified = load_little_endian<std::uint8_t>(fields, 6) >= 200;
    record.xxh3 = load_little_endian<std::uint8_t>(fields, 7);
    // Sometimes the limits of the ranges.
    if (load_little_endian<std::uint8_t>(fields, 8) > 250) record.offset = ~record.offset;
    if (load_little_endian<std::uint8_t>(fields, 9) > 250) record.size = ~record.size;
    record.arrival_ns = load_little_endian<std::int8_t>(fields, 10);
    record.sequence = load_little_endian<std::uint8_t>(fields, 11);
    if (version == 1) {
      append(bytes, store::journal::encode_record_v1(record));
    } else {
      append(bytes, store::journal::encode_record(record));
    }
  }
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  static const Bytes archive = make_archive();
  const auto input = std::as_bytes(std::span(data, size)).subspan(1);
  const Bytes journal =
      data[0] % 2 == 1 ? seal(input, data[0] % 4 == 1 ? 2 : 1) : Bytes(input.begin(), input.end());
  try {
    const auto index = store::index_archive(archive, journal, "archive", "journal");
    check_index(index, archive);
  } catch (const Error&) {
  }
  return 0;
}
