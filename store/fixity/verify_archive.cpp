// SPDX-License-Identifier: Apache-2.0
// Verifies an archive against its journal. Generates header, cluster headers and Cues from the
// records and compares them byte by byte, then checks the XXH3 of each JPEG. Input: the bytes of
// both files; output: problems with offsets and frames. Cost: O(bytes); at depth kJournal without
// the JPEG bytes.
#include "store/fixity/verify_archive.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "base/cancellation.h"
#include "store/fixity/decoded_frame_check.h"
#include "store/fixity/header_damage.h"
#include "store/journal.h"
#include "store/matroska.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {
namespace {

using Bytes = std::span<const std::byte>;

class Verifier {
 public:
  Verifier(const ArchivePair& pair, const VerifyOptions& options)
      : pair_(pair),
        options_(options),
        archive_(pair.archive),
        header_(!pair.journal || can_read(*pair.journal)
                    ? header_of_pair(pair)
                    : matroska::header_of_file(pair.archive, pair.description)),
        decode_(pair, header_.codec) {
    const Bytes expected(header_.bytes);
    const auto field = [&](Bytes bytes) {
      return bytes.subspan(header_.segment_size_offset,
                           header_.segment_data_offset - header_.segment_size_offset);
    };
    claims_closed_ = archive_.size() >= header_.segment_data_offset &&
                     !std::ranges::equal(field(archive_), field(expected));
  }

  ArchiveFixityReport run() {
    try {
      verify();
    } catch (const Cancelled&) {  // the report says that it was stopped
      if (!options_.stop.stop_requested()) throw;
    }
    report_.status = options_.stop.stop_requested() ? RunStatus::kStopped : RunStatus::kFinished;
    return std::move(report_);
  }

 private:
  void verify() {
    if (!check_journal_header()) return;
    if (!can_read(archive_.first(std::min(archive_.size(), header_.bytes.size())))) {
      add(pair_.archive_name, 0, "the disk cannot read the header");
      return;
    }
    if (options_.depth == VerifyDepth::kSizes) {
      check_sizes();
    } else {
      check_everything();
    }
  }

  FixityProblem* add(const std::string& file, std::uint64_t offset, std::string what,
                     std::vector<AffectedFrame> frames = {}) {
    if (report_.problems.size() >= kMaxProblems) {
      ++report_.omitted_problems;
      return nullptr;
    }
    return &report_.problems.emplace_back(
        FixityProblem{file, offset, std::move(what), std::move(frames), false});
  }

  void add_loss(std::uint64_t offset, std::string what, std::vector<AffectedFrame> frames) {
    FixityProblem* problem = add(pair_.archive_name, offset, std::move(what), std::move(frames));
    if (problem != nullptr) problem->loses_frames = true;
  }

  bool can_read(Bytes bytes) const {
    if (!options_.can_read) return true;
    while (!bytes.empty()) {  // of any size, if the file has holes
      throw_if_cancelled();
      const Bytes part = bytes.first(std::min(kReadPart, bytes.size()));
      if (!options_.can_read(part)) return false;
      bytes = bytes.subspan(part.size());
    }
    return true;
  }
  void advance(std::uint64_t bytes) const {
    if (options_.progress) options_.progress(bytes);
  }

  // Returns false if verification cannot continue.
  bool check_journal_header() {
    if (!pair_.journal) {
      add(pair_.journal_name, 0, "the journal is missing: no frame can be verified");
      return true;
    }
    const Bytes journal = *pair_.journal;
    if (!can_read(journal)) {
      add(pair_.journal_name, 0, "the disk cannot read the journal");
      return false;
    }
    version_ = journal_version(journal, pair_.journal_name);
    const auto expected = journal::encode_header(pair_.description, version_);
    const Bytes found = journal.first(std::min(journal.size(), expected.size()));
    if (std::ranges::equal(found, expected)) return true;
    if (journal::decode_header(journal, pair_.journal_name)) {
      add(pair_.journal_name, first_difference(found, expected),
          "the journal is of another camera or take");
      return false;
    }
    add(pair_.journal_name, first_difference(found, expected),
        found.size() < expected.size() ? "the journal ends within its header"
                                       : "the journal's header is damaged");
    return true;
  }

  void check_sizes();
  void check_everything();
  void check_slot(std::uint64_t at, Bytes slot);
  void check_stored(std::uint64_t at, const FrameRecord& record);
  void check_gap(std::size_t end);
  void check_frame(const FrameRecord& record);
  std::optional<std::uint64_t> xxh3_of(Bytes jpeg) const;
  void check_decoded(Bytes frame, const FrameRecord& record, const AffectedFrame& affected);
  void check_end();
  void check_header(const matroska::Trailer& closing);
  void take_frame(Nanoseconds time, std::size_t cluster, std::size_t end);
  bool report_cut_off();
  void report_not_closed(std::string what);

  const ArchivePair& pair_;
  const VerifyOptions& options_;
  Bytes archive_;
  matroska::Header header_;
  bool claims_closed_ = false;
  std::uint32_t version_ = journal::kVersion;

  std::size_t cursor_ = 0;  // one past the last cluster so far
  std::vector<matroska::CuePoint> cues_;
  Nanoseconds last_time_ = 0, last_stored_time_ = -1;
  std::vector<std::size_t> damaged_records_;  // since the last stored frame; into report_.problems
  std::vector<AffectedFrame> cut_off_;
  std::vector<matroska::CuePoint> cut_cues_;  // of those
  std::uint64_t cut_end_ = 0;
  std::size_t torn_journal_bytes_ = 0;
  std::size_t slot_ = journal::kHeaderBytes;  // of the record that is checked
  DecodedFrameCheck decode_;
  ArchiveFixityReport report_;
};

void Verifier::report_not_closed(std::string what) {
  FixityProblem* problem = add(pair_.archive_name, cursor_, std::move(what));
  if (problem != nullptr) problem->not_closed = true;
}

void Verifier::check_sizes() {
  std::uint64_t end = header_.bytes.size();
  if (pair_.journal && pair_.journal->size() >= journal::kHeaderBytes) {
    const Bytes records = pair_.journal->subspan(journal::kHeaderBytes);
    const std::size_t step = journal::record_bytes(version_);
    const std::size_t torn = records.size() % step;
    if (torn > 0 && claims_closed_) {
      add(pair_.journal_name, pair_.journal->size() - torn, "the journal ends within a record");
    }
    for (std::size_t i = records.size() / step; i-- > 0;) {
      if (options_.stop.stop_requested()) return;
      const auto record = journal::decode_record(records.subspan(i * step, step), version_);
      if (!record || record->status != FrameStatus::kStored) continue;
      end = record->offset + record->size;
      break;
    }
  }
  if (archive_.size() < end) {
    add(pair_.archive_name, archive_.size(),
        fmt::format("the archive ends here, but its last frame ends at {}", end));
    return;
  }
  if (!claims_closed_) {
    cursor_ = static_cast<std::size_t>(std::min<std::uint64_t>(end, archive_.size()));
    report_not_closed("the recording was not closed");
    return;
  }
  const auto said = matroska::make_segment_size(archive_.size() - header_.segment_data_offset);
  if (!std::ranges::equal(said, archive_.subspan(header_.segment_size_offset, said.size()))) {
    add(pair_.archive_name, header_.segment_size_offset,
        "the size of the archive differs from the one in its header");
  }
}

void Verifier::check_everything() {
  cursor_ = header_.bytes.size();
  if (pair_.journal && pair_.journal->size() > journal::kHeaderBytes) {
    const std::size_t step = journal::record_bytes(version_);
    const Bytes journal = *pair_.journal;
    std::size_t at = journal::kHeaderBytes;
    for (; journal.size() - at >= step && !options_.stop.stop_requested(); at += step) {
      check_slot(at, journal.subspan(at, step));
      advance(step);
    }
    if (options_.stop.stop_requested()) return;
    torn_journal_bytes_ = journal.size() - at;
  }
  if (!report_cut_off()) check_end();
}

void Verifier::check_slot(std::uint64_t at, Bytes slot) {
  slot_ = at;
  const auto record = journal::decode_record(slot, version_);
  const auto complain = [&](std::string what) {
    if (add(pair_.journal_name, at, std::move(what)) != nullptr) {
      damaged_records_.push_back(report_.problems.size() - 1);
    }
  };
  if (!record) {
    complain("the record fails its check: its data on the frame are not reliable");
  } else if (record->time_ns < last_time_ || record->time_ns > matroska::kMaxTime) {
    complain("the record's time is not after the previous one");
  } else if (record->status == FrameStatus::kStored) {
    check_stored(at, *record);
  } else {
    last_time_ = record->time_ns;
    report_.has_gaps_in_video =
        report_.has_gaps_in_video ||
        (record->status == FrameStatus::kTorn && is_temporal(header_.codec));
    if (record->offset != 0 || record->size != 0 || record->xxh3 != 0) {
      complain("the record of a missing frame refers to bytes in the archive");
    }
  }
}

void Verifier::check_stored(std::uint64_t at, const FrameRecord& record) {
  constexpr std::size_t kHeader = matroska::kClusterHeaderBytes;
  if (record.time_ns <= last_stored_time_ || record.size == 0 ||
      record.offset < cursor_ + kHeader) {
    add(pair_.journal_name, at, "the record refers to another frame's bytes, or none");
    return;
  }
  last_time_ = record.time_ns;
  if (record.offset > archive_.size() || record.size > archive_.size() - record.offset) {
    cut_off_.push_back(
        {report_.frames + static_cast<std::int64_t>(cut_off_.size()), record.time_ns});
    constexpr std::uint64_t kLargestFile = std::uint64_t{1} << 55;  // that Matroska can describe
    if (record.offset < kLargestFile) {
      cut_cues_.push_back({record.time_ns, record.offset - kHeader});
      cut_end_ = record.offset + record.size;
    }
    return;
  }
  const auto cluster = static_cast<std::size_t>(record.offset) - kHeader;
  if (cluster > cursor_) check_gap(cluster);
  damaged_records_.clear();
  report_.unverified_frames += record.is_unverified ? 1 : 0;
  check_frame(record);
  if (options_.stop.stop_requested()) return;  // it may be unchecked
  take_frame(record.time_ns, cluster, cluster + kHeader + record.size);
  if (options_.on_intact_frames && report_.problems.empty())
    options_.on_intact_frames(report_.frames);
}

/// Returns the XXH3-64 of a frame; nullopt if the disk cannot read it. Large frames are never in
/// memory as a whole.
std::optional<std::uint64_t> Verifier::xxh3_of(Bytes jpeg) const {
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(
      jpeg.size() > kReadPart ? XXH3_createState() : nullptr, XXH3_freeState);
  if (state) XXH3_64bits_reset(state.get());
  for (std::size_t at = 0; at < jpeg.size(); at += kReadPart) {
    const Bytes part = jpeg.subspan(at, std::min(kReadPart, jpeg.size() - at));
    if (options_.stop.stop_requested()) return std::nullopt;
    if (options_.before_read) options_.before_read(part);
    if (!can_read(part)) return std::nullopt;
    if (!state) {
      const std::uint64_t hash = XXH3_64bits(part.data(), part.size());
      if (options_.after_read) options_.after_read(part);
      return hash;
    }
    XXH3_64bits_update(state.get(), part.data(), part.size());
    if (options_.after_read) options_.after_read(part);
  }
  return XXH3_64bits_digest(state.get());
}

void Verifier::take_frame(Nanoseconds time, std::size_t cluster, std::size_t end) {
  cues_.push_back({time, cluster});
  last_stored_time_ = time;
  cursor_ = end;
  ++report_.frames;
}

// Checks bytes without an intact record: the frames of damaged records, or damage.
void Verifier::check_gap(std::size_t end) {
  std::vector<AffectedFrame> found;
  while (cursor_ < end) {
    const auto frame = matroska::parse_cluster(archive_.first(end), cursor_);
    if (!frame) break;
    found.push_back({report_.frames, frame->time});
    take_frame(frame->time, cursor_, frame->offset + frame->size);
  }
  if (cursor_ < end) {
    add(pair_.archive_name, cursor_,
        fmt::format("{} bytes that are not a whole frame, without an intact journal record",
                    end - cursor_));
    for (const auto& frame : matroska::scan_clusters(archive_, cursor_, end)) {
      found.push_back({report_.frames, frame.time});
      take_frame(frame.time, frame.offset - matroska::kClusterHeaderBytes,
                 frame.offset + frame.size);
    }
  }
  for (const std::size_t problem : damaged_records_) report_.problems[problem].frames = found;
  if (damaged_records_.empty() && !found.empty()) {
    add(pair_.journal_name, 0, "frames in the archive are not in the journal", std::move(found));
  }
}

void Verifier::check_frame(const FrameRecord& record) {
  const auto offset = static_cast<std::size_t>(record.offset);
  const AffectedFrame affected{report_.frames, record.time_ns};
  const Bytes found =
      archive_.subspan(offset - matroska::kClusterHeaderBytes, matroska::kClusterHeaderBytes);
  const Bytes jpeg = archive_.subspan(offset, record.size);
  const bool deep = options_.depth == VerifyDepth::kHashes || options_.decode;
  const bool may_refer =
      is_temporal(header_.codec);  // its beginning says whether it is a key frame
  const std::size_t start = may_refer ? std::min(kFrameLinkBytes, jpeg.size()) : 0;
  if (report_.frames < options_.checked_frames && report_.problems.empty()) {
    if (options_.decode && may_refer && can_read(jpeg.first(start)) && is_key_frame(jpeg)) {
      decode_.skip_key_frame({record, slot_, version_});
    }
    if (deep) advance(jpeg.size());
    return;
  }
  const auto hash = deep ? xxh3_of(jpeg) : std::nullopt;
  if (options_.stop.stop_requested()) return;
  if (!can_read({found.data(), found.size() + start}) || (deep && !hash)) {
    add_loss(offset, "the disk cannot read the frame", {affected});
    return;
  }
  const auto expected =
      matroska::make_cluster_header(record.time_ns, record.size, !may_refer || is_key_frame(jpeg));
  if (!std::ranges::equal(found, expected)) {
    add(pair_.archive_name, offset - expected.size() + first_difference(found, expected),
        "the Matroska header of a frame is damaged; other programs may lose the frame or its time",
        {affected});
  }
  if (options_.depth == VerifyDepth::kHashes && *hash != record.xxh3) {
    add_loss(offset,
             fmt::format("the {} bytes of a frame differ from the recorded ones: wrong XXH3",
                         jpeg.size()),
             {affected});
  }
  if (options_.decode) check_decoded(jpeg, record, affected);
  if (deep) advance(jpeg.size());
}

void Verifier::check_decoded(Bytes frame, const FrameRecord& record,
                             const AffectedFrame& affected) {
  if (auto problem = decode_.problem_of(frame, {record, slot_, version_})) {
    add(pair_.archive_name, record.offset, std::move(*problem), {affected});
  }
}

// Reports a truncated archive as a single problem; the journal still gives its header. Returns
// whether the archive is truncated.
bool Verifier::report_cut_off() {
  if (cut_off_.empty()) return false;
  std::string what = fmt::format(
      "the archive ends here; frames that the journal lists are lost: {}", cut_off_.size());
  add_loss(archive_.size(), std::move(what), std::move(cut_off_));
  cues_.insert(cues_.end(), cut_cues_.begin(), cut_cues_.end());
  check_header(matroska::make_trailer(cues_, header_, std::max<std::uint64_t>(cut_end_, cursor_)));
  if (!claims_closed_) report_not_closed("the recording was not closed");
  return true;
}

// Checks the bytes after the last frame that the journal lists.
void Verifier::check_end() {
  const Bytes cues_and_more = archive_.subspan(std::min(cursor_, archive_.size()));
  if (!can_read(cues_and_more)) {
    add(pair_.archive_name, cursor_, "the disk cannot read the bytes after the frames");
    return;
  }
  std::vector<AffectedFrame> unlisted;
  while (const auto frame = matroska::parse_cluster(archive_, cursor_)) {
    unlisted.push_back({report_.frames, frame->time});
    take_frame(frame->time, cursor_, frame->offset + frame->size);
  }
  for (const std::size_t problem : damaged_records_) report_.problems[problem].frames = unlisted;
  // A crash between frames and their records leaves some such frames; more are damage.
  const bool as_a_crash = !claims_closed_ && damaged_records_.empty() && pair_.journal;
  if (!unlisted.empty() && !as_a_crash && damaged_records_.empty()) {
    add(pair_.journal_name, pair_.journal ? pair_.journal->size() : 0,
        "frames in the archive are not in the journal", unlisted);
  }
  if (torn_journal_bytes_ > 0 && claims_closed_) {
    add(pair_.journal_name, pair_.journal->size() - torn_journal_bytes_,
        "the journal ends within a record");
  }

  const auto closing = matroska::make_trailer(cues_, header_, cursor_);
  check_header(closing);
  const Bytes tail = archive_.subspan(std::min(cursor_, archive_.size()));
  if (!claims_closed_) {
    std::string what = "the recording was not closed";
    if (as_a_crash && !unlisted.empty()) {
      what += fmt::format("; frames that the journal lacks: {}", unlisted.size());
    }
    if (torn_journal_bytes_ > 0) what += "; its last record is torn";
    if (!tail.empty()) what += fmt::format("; {} bytes follow the last whole frame", tail.size());
    report_not_closed(std::move(what));
    return;
  }
  if (std::ranges::equal(tail, closing.cues)) return;
  const std::size_t at = first_difference(tail, closing.cues);
  std::string what = at == closing.cues.size()
                         ? fmt::format("{} surplus bytes after the Cues", tail.size() - at)
                     : at == tail.size() ? std::string("the archive ends within its Cues")
                                         : std::string("the Cues are damaged");
  add(pair_.archive_name, cursor_ + at,
      what + "; other programs may seek wrongly, no frame is affected");
}

void Verifier::check_header(const matroska::Trailer& closing) {
  for (Damage& damage : find_header_damage(archive_, header_, closing, claims_closed_)) {
    add(pair_.archive_name, damage.offset, std::move(damage.what));
  }
}

}  // namespace

std::uint32_t journal_version(Bytes journal, std::string_view name) {
  if (const auto header = journal::decode_header(journal, name)) return header->version;
  if (journal.size() <= journal::kHeaderBytes) return journal::kVersion;
  const auto good = [&](std::uint32_t version) {
    const std::size_t step = journal::record_bytes(version);
    std::size_t count = 0;
    for (Bytes rest = journal.subspan(journal::kHeaderBytes); rest.size() >= step;
         rest = rest.subspan(step)) {
      count += journal::decode_record(rest.first(step), version) ? 1 : 0;
    }
    return count;
  };
  return good(1) > good(2) ? 1 : 2;
}

matroska::Header header_of_pair(const ArchivePair& pair) {
  std::optional<std::size_t> first_cluster;
  if (pair.journal && pair.journal->size() > journal::kHeaderBytes) {
    const std::uint32_t version = journal_version(*pair.journal, pair.journal_name);
    const std::size_t step = journal::record_bytes(version);
    for (Bytes rest = pair.journal->subspan(journal::kHeaderBytes);
         rest.size() >= step && !first_cluster; rest = rest.subspan(step)) {
      const auto record = journal::decode_record(rest.first(step), version);
      if (!record || record->status != FrameStatus::kStored) continue;
      if (record->offset < matroska::kClusterHeaderBytes) break;
      first_cluster = static_cast<std::size_t>(record->offset) - matroska::kClusterHeaderBytes;
    }
  }
  return matroska::header_of_file(pair.archive, pair.description, first_cluster);
}

ArchiveFixityReport verify_archive(const ArchivePair& pair, const VerifyOptions& options) {
  const CancellationScope scope(options.stop.stop_possible() ? options.stop
                                                             : current_cancellation());
  if (pair.journal) journal::require_possible_size(pair.journal->size(), pair.journal_name);
  try {
    return Verifier(pair, options).run();
  } catch (const Cancelled&) {  // while it began
    if (!options.stop.stop_requested()) throw;
    ArchiveFixityReport stopped;
    stopped.status = RunStatus::kStopped;
    return stopped;
  }
}

}  // namespace raystage::store
