// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <xxhash.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/little_endian.h"
#include "store/fixity/verify_archive.h"
#include "store/journal.h"
#include "store/matroska.h"

namespace raystage {

/// An archive and its journal in memory, written by docs/formats and not by ArchiveWriter.
struct FuzzArchive {
  std::vector<std::byte> archive, journal;
  bool has_journal = true;

  static store::ArchiveWriter::Description description() { return {"c0", 8, 8, 0}; }

  store::ArchivePair pair() const {
    store::ArchivePair result{archive, std::nullopt, "archive", "journal", description()};
    if (has_journal) result.journal = journal;
    return result;
  }

  void add(const store::FrameRecord& record, std::span<const std::byte> jpeg,
           std::uint32_t version) {
    store::FrameRecord line = record;
    if (record.status == store::FrameStatus::kStored) {
      cues.push_back({record.time_ns, archive.size()});
      append(archive, store::matroska::make_cluster_header(record.time_ns, jpeg.size()));
      line.offset = archive.size();
      append(archive, jpeg);
    }
    if (version == 1) {
      append(journal, store::journal::encode_record_v1(line));
    } else {
      append(journal, store::journal::encode_record(line));
    }
  }
  void begin(std::uint32_t version) {
    append(archive, store::matroska::make_header(description()).bytes);
    append(journal, store::journal::encode_header(description(), version));
  }
  void close() {
    const auto header = store::matroska::make_header(description());
    const auto closing = store::matroska::make_trailer(cues, header, archive.size());
    const auto put = [&](std::size_t at, const std::vector<std::byte>& bytes) {
      std::ranges::copy(bytes, archive.begin() + static_cast<std::ptrdiff_t>(at));
    };
    append(archive, closing.cues);
    put(header.duration_offset, closing.duration);
    put(header.rate_offset, closing.rate);
    put(header.seek_head_offset, closing.seek_head);
    put(header.segment_size_offset, closing.segment_size);
  }

  template <typename Range>
  static void append(std::vector<std::byte>& bytes, const Range& more) {
    bytes.insert(bytes.end(), std::begin(more), std::end(more));
  }

 private:
  std::vector<store::matroska::CuePoint> cues;
};

inline FuzzArchive make_intact_archive(bool closed, std::uint32_t version) {
  constexpr std::size_t kFrameBytes = 20;
  FuzzArchive pair;
  pair.begin(version);
  for (unsigned i = 0; i < 5; ++i) {
    const std::vector<std::byte> jpeg(kFrameBytes + i, static_cast<std::byte>(i + 1));
    const auto time = static_cast<Nanoseconds>(10 * (i + 1));
    pair.add({time, 0, static_cast<std::uint32_t>(jpeg.size()), store::FrameStatus::kStored,
              XXH3_64bits(jpeg.data(), jpeg.size()), time + 1, i},
             jpeg, version);
    if (i == 2)
      pair.add({time, 0, 0, store::FrameStatus::kDroppedLate, 0, time + 2, 99}, {}, version);
  }
  if (closed) pair.close();
  return pair;
}

/// Returns a damaged archive. The first byte selects the original: bit 0: closed; bit 1: journal of
/// version 1; bit 2: no journal. If bit 3 is set, the rest are the two files after the archive's
/// length. Otherwise they are edits of four bytes: operation and file, position (two bytes), value.
inline FuzzArchive make_damaged_archive(std::span<const std::byte> input) {
  if (input.empty()) return make_intact_archive(true, 2);
  const auto flags = std::to_integer<unsigned>(input[0]);
  FuzzArchive pair = make_intact_archive((flags & 1) != 0, (flags & 2) != 0 ? 1 : 2);
  pair.has_journal = (flags & 4) == 0;
  input = input.subspan(1);
  if ((flags & 8) != 0) {
    if (input.size() < 2) return pair;
    const std::size_t said = load_little_endian<std::uint16_t>(input, 0);
    const std::size_t size = std::min(said, input.size() - 2);
    pair.archive.assign(input.begin() + 2, input.begin() + 2 + static_cast<std::ptrdiff_t>(size));
    pair.journal.assign(input.begin() + 2 + static_cast<std::ptrdiff_t>(size), input.end());
    return pair;
  }
  for (; input.size() >= 4; input = input.subspan(4)) {
    const auto what = std::to_integer<unsigned>(input[0]);
    auto& file = (what & 1) != 0 ? pair.journal : pair.archive;
    if (file.empty()) continue;
    const std::size_t at = load_little_endian<std::uint16_t>(input, 1) % file.size();
    const auto place = file.begin() + static_cast<std::ptrdiff_t>(at);
    const auto count =
        std::min<std::ptrdiff_t>(std::to_integer<std::ptrdiff_t>(input[3]), file.end() - place);
    switch ((what >> 1) % 6) {
      case 0:
        *place ^= input[3];
        break;
      case 1:
        *place = input[3];
        break;
      case 2:
        file.resize(at);
        break;
      case 3:
        file.erase(place, place + count);
        break;
      case 4:
        std::fill(place, place + count, std::byte{0});
        break;
      default:
        file.insert(place, static_cast<std::size_t>(count), input[3]);
    }
  }
  return pair;
}

}  // namespace raystage
