// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "store/fixity/verify_archive.h"
#include "store/journal.h"
#include "store/matroska.h"
#include "testing/store/archive_test_data.h"
#include "testing/test_folder.h"

namespace raystage::testing {

/// For tests: the bytes of an archive and its journal.
struct PairBytes {
  std::vector<std::byte> archive, journal;
  bool has_journal = true;

  store::ArchivePair pair() const {
    store::ArchivePair result{archive, std::nullopt, "r0c0.mkv", "r0c0.journal", description()};
    if (has_journal) result.journal = journal;
    return result;
  }
};

inline Nanoseconds frame_time(unsigned i) { return 1000 * (i + 1); }
inline store::FrameOrigin frame_origin(unsigned i) { return {frame_time(i) + 13, i + 5}; }
inline std::vector<std::byte> frame_bytes(unsigned i) { return fake_jpeg(i, 40 + 3 * (i % 10)); }

/// Returns an archive of `frames` frames with a missing one after each third. If not `closed`, it
/// is as a crash leaves it.
inline PairBytes make_pair(unsigned frames, bool closed) {
  const TestFolder folder;
  const auto archive = folder.path() / "a.mkv", journal = folder.path() / "a.journal";
  PairBytes bytes;
  store::ArchiveWriter out(archive, journal, description());
  for (unsigned i = 0; i < frames; ++i) {
    out.append(frame_bytes(i), frame_time(i), frame_origin(i));
    if (i % 3 == 2)
      out.append_missing(store::FrameStatus::kDroppedLate, frame_time(i), {1, 100 + i});
  }
  if (closed) out.close();
  bytes.archive = bytes_of(archive);
  bytes.journal = bytes_of(journal);
  return bytes;
}

/// Returns the same with a journal of version 1.
inline PairBytes with_journal_v1(PairBytes bytes) {
  const auto contents = store::journal::decode(bytes.journal, "journal");
  const auto header = store::journal::encode_header(description(), 1);
  bytes.journal.assign(header.begin(), header.end());
  for (const store::FrameRecord& record : contents.records) {
    const auto line = store::journal::encode_record_v1(record);
    bytes.journal.insert(bytes.journal.end(), line.begin(), line.end());
  }
  return bytes;
}

/// Returns the same with the archive of the first version, whose header has no space for the rate.
inline PairBytes with_archive_v1(const PairBytes& bytes, bool closed) {
  namespace mkv = store::matroska;
  const mkv::Header now = mkv::make_header(description());
  const mkv::Header first = mkv::make_header(description(), mkv::HeaderForm::kWithoutRate);
  const std::uint64_t shift = now.bytes.size() - first.bytes.size();
  PairBytes old;
  const auto header = store::journal::encode_header(description());
  old.journal.assign(header.begin(), header.end());
  std::vector<mkv::CuePoint> points;
  std::uint64_t end = now.bytes.size();
  for (store::FrameRecord record : store::journal::decode(bytes.journal, "journal").records) {
    if (record.status == store::FrameStatus::kStored) {
      end = record.offset + record.size;
      record.offset -= shift;
      points.push_back({record.time_ns, record.offset - mkv::kClusterHeaderBytes});
    }
    const auto line = store::journal::encode_record(record);
    old.journal.insert(old.journal.end(), line.begin(), line.end());
  }
  old.archive = first.bytes;
  old.archive.insert(old.archive.end(),
                     bytes.archive.begin() + static_cast<std::ptrdiff_t>(now.bytes.size()),
                     bytes.archive.begin() + static_cast<std::ptrdiff_t>(end));
  if (!closed) return old;
  const mkv::Trailer trailer = mkv::make_trailer(points, first, old.archive.size());
  old.archive.insert(old.archive.end(), trailer.cues.begin(), trailer.cues.end());
  const auto put = [&](std::size_t offset, const std::vector<std::byte>& part) {
    std::ranges::copy(part, old.archive.begin() + static_cast<std::ptrdiff_t>(offset));
  };
  put(first.segment_size_offset, trailer.segment_size);
  put(first.duration_offset, trailer.duration);
  put(first.seek_head_offset, trailer.seek_head);
  return old;
}

inline void flip(std::vector<std::byte>& bytes, std::size_t bit) {
  bytes[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
}

}  // namespace raystage::testing
