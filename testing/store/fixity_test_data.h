// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "store/fixity/verify_archive.h"
#include "store/journal.h"
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

inline void flip(std::vector<std::byte>& bytes, std::size_t bit) {
  bytes[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
}

}  // namespace raystage::testing
