// SPDX-License-Identifier: Apache-2.0
// Takes the records that a crash prevented from another copy of the archive. Cost: linear in the
// records, and in the bytes of the frames that a journal lacks.
#include "store/unlisted_frames.h"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "store/journal.h"
#include "store/lost_frames.h"
#include "store/stored_frames.h"

namespace raystage::store {
namespace {

bool is_same_frame(const FrameRecord& a, const FrameRecord& b) {
  return a.status == b.status && a.time_ns == b.time_ns && a.offset == b.offset &&
         a.size == b.size && a.xxh3 == b.xxh3;
}

/// Returns whether a journal exists with an intact header: without one it has no records.
bool has_header(const std::filesystem::path& journal) {
  std::array<std::byte, journal::kHeaderBytes> bytes{};
  const std::size_t size = read_file_part(journal, 0, bytes);
  return journal::decode_header(std::span(bytes).first(size), journal.string()).has_value();
}

ArchiveWriter::Description description_in(const ArchiveFiles& files) {
  return ArchiveReader(files.archive, files.journal).description();
}

}  // namespace

CopyRecords read_copy_records(const ArchiveFiles& files) {
  CopyRecords copy;
  copy.has_journal = has_header(files.journal);
  const ArchiveReader reader(files.archive, files.journal);
  const StoredFrames stored_frames(files.archive);
  copy.records.assign(reader.records().begin(), reader.records().end());
  for (std::size_t i = 0; i < copy.records.size(); ++i) {
    FrameRecord& record = copy.records[i];
    if (record.status == FrameStatus::kStored && is_lost(reader, record)) {
      record = {.time_ns = record.time_ns,  // as a resumed recording has it
                .status = FrameStatus::kTorn,
                .arrival_ns = record.arrival_ns,
                .sequence = record.sequence};
    }
    const bool is_stored = record.status == FrameStatus::kStored;
    if (!is_stored || record.xxh3 != 0) {
      copy.listed = i + 1;
      continue;
    }
    const FrameBytes stored = stored_frames.read(record);
    record.xxh3 = XXH3_64bits(stored.bytes().data(), stored.bytes().size());
  }
  return copy;
}

bool is_same_record(const FrameRecord& a, const FrameRecord& b) {
  FrameRecord same = b;
  if (a.arrival_ns == kUnknownTime || b.arrival_ns == kUnknownTime) {
    same.arrival_ns = a.arrival_ns;
    same.sequence = a.sequence;
  }
  same.is_unverified = a.is_unverified;
  return a == same;
}

std::optional<std::vector<FrameRecord>> complete_records(const CopyRecords& own,
                                                         const CopyRecords& other) {
  // Not by a crash: a recording creates the journal before its first frame.
  if (!own.has_journal && !other.records.empty()) return std::nullopt;
  const std::span<const FrameRecord> here(own.records), there(other.records);
  const std::size_t common = std::min(own.listed, there.size());
  if (!std::ranges::equal(here.first(common), there.first(common), is_same_record)) {
    return std::nullopt;
  }
  const auto listed = here.first(own.listed);
  std::vector<FrameRecord> complete(listed.begin(), listed.end());
  auto known = there.subspan(common);
  for (FrameRecord frame : here.subspan(own.listed)) {
    while (!known.empty() && known.front().status != FrameStatus::kStored &&
           known.front().time_ns <= frame.time_ns) {
      complete.push_back(known.front());
      known = known.subspan(1);
    }
    if (!known.empty()) {
      if (!is_same_frame(frame, known.front())) return std::nullopt;
      frame.arrival_ns = known.front().arrival_ns;
      frame.sequence = known.front().sequence;
      const bool is_listed = there.size() - known.size() < other.listed;
      if (is_listed) frame.is_unverified = known.front().is_unverified;
      known = known.subspan(1);
    }
    complete.push_back(frame);
  }
  return complete;
}

void complete_journal(const ArchiveFiles& own, const ArchiveFiles& other) {
  // Locked before it is read: no recorder appends meanwhile.
  const OutputFile lock(own.archive, OutputFile::Open::kExisting);
  const CopyRecords here = read_copy_records(own);
  if (here.listed == here.records.size()) return;
  const auto complete = complete_records(here, read_copy_records(other));
  if (!complete) {
    throw Error::bad_input("frames at the end have no record, and the other copy has others",
                           own.archive.string(),
                           "Run `raystage repair` on each copy with the other as its copy");
  }
  std::vector<std::byte> contents;
  const auto add = [&](const auto& bytes) {
    contents.insert(contents.end(), bytes.begin(), bytes.end());
  };
  add(journal::encode_header(description_in(own)));
  for (const FrameRecord& record : *complete) add(journal::encode_record(record));
  write_file_atomically(own.journal, contents);
}

}  // namespace raystage::store
