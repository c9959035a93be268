// SPDX-License-Identifier: Apache-2.0
// Appends frames to an archive and its journal (layouts: matroska.h, docs/formats/journal.md). The
// archive is written before the journal, so each record has its frame. After a failed write both
// files are truncated to the last complete frame. Cost: one hash (XXH3) per frame and one write to
// each file per call.
#include "store/archive_writer_files.h"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>
#include <system_error>
#include <utility>
#include <vector>

#include "base/error.h"
#include "store/journal.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {
namespace {

constexpr const char* kMakeRoom = "Free space on the disk or choose another one";

}  // namespace

ArchiveWriter::Files::Files(const std::filesystem::path& archive_path,
                            const std::filesystem::path& journal_path,
                            const Description& description)
    : archive(archive_path), header(matroska::make_header(description)) {
  try {
    journal = std::make_unique<OutputFile>(journal_path);
    const auto start = [](OutputFile& file, std::span<const std::byte> bytes) {
      if (file.write_at(0, bytes)) return;
      const int reason = errno;
      file.discard();
      errno = reason;
      throw Error::from_errno("the file cannot be written", file.path().string(), kMakeRoom);
    };
    const auto journal_header = journal::encode_header(description);
    start(*journal, journal_header);
    journal_end = journal_header.size();
    try {
      start(archive, header.bytes);
    } catch (const Error&) {
      journal->discard();
      throw;
    }
    archive_end = header.bytes.size();
  } catch (const Error&) {
    archive.discard();
    throw;
  }
}

void ArchiveWriter::Files::check(std::span<const NewFrame> frames) const {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input(what, archive.path().string(),
                            "Give each frame its time since the take's epoch, in order");
  };
  Nanoseconds last = last_time, last_stored = last_stored_time;
  for (const NewFrame& frame : frames) {
    const Nanoseconds time = frame.time_ns;
    const bool stored = frame.status == FrameStatus::kStored;
    if (time < 0 || time > matroska::kMaxTime) {
      throw refuse("a frame at " + std::to_string(time) +
                   " ns is outside of 0 to 104 days since the epoch");
    }
    if (time < last || (stored && time == last_stored)) {
      throw refuse("a frame at " + std::to_string(time) + " ns does not follow the one at " +
                   std::to_string(last) + " ns");
    }
    if (stored &&
        (frame.jpeg.empty() || frame.jpeg.size() > std::numeric_limits<std::uint32_t>::max())) {
      throw Error::bad_input(
          "a frame of " + std::to_string(frame.jpeg.size()) + " bytes cannot be stored",
          archive.path().string(),
          "Store frames of 1 byte to 4 GiB; record missing frames as missing");
    }
    last = time;
    if (stored) last_stored = time;
  }
}

Error ArchiveWriter::Files::roll_back(const OutputFile& failed) {
  const std::string reason = std::generic_category().message(errno);
  const bool clean = archive.truncate(archive_end) && journal->truncate(journal_end);
  return Error::failed(
      "writing failed: " + reason +
          (clean ? "; the archive ends with its last whole frame, number " +
                       std::to_string(cues.size())
                 : std::string("; the archive may end with a torn frame, which readers skip")),
      failed.path().string(), kMakeRoom);
}

void ArchiveWriter::Files::append(std::span<const NewFrame> frames) {
  check(frames);
  std::vector<std::array<std::byte, matroska::kClusterHeaderBytes>> heads(frames.size());
  std::vector<std::span<const std::byte>> parts;
  std::vector<std::byte> lines;
  std::vector<matroska::CuePoint> points;
  std::uint64_t end = archive_end;
  Nanoseconds last_stored = last_stored_time;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const NewFrame& frame = frames[i];
    FrameRecord record{frame.time_ns,        0, 0, frame.status, 0, frame.origin.arrival_ns,
                       frame.origin.sequence};
    if (frame.status == FrameStatus::kStored) {
      record.offset = end + matroska::kClusterHeaderBytes;
      record.size = static_cast<std::uint32_t>(frame.jpeg.size());
      record.xxh3 = XXH3_64bits(frame.jpeg.data(), frame.jpeg.size());
      record.is_unverified = frame.is_unverified;
      heads[i] =
          matroska::make_cluster_header(frame.time_ns, frame.jpeg.size(), is_key_frame(frame.jpeg));
      parts.insert(parts.end(), {heads[i], frame.jpeg});
      points.push_back({frame.time_ns, end});
      end = record.offset + record.size;
      last_stored = frame.time_ns;
    }
    const auto line = journal::encode_record(record);
    lines.insert(lines.end(), line.begin(), line.end());
  }
  // Allocate first: after the bytes are on disk only the disk may fail.
  if (cues.capacity() - cues.size() < points.size()) {
    cues.reserve(std::max(2 * cues.capacity(), cues.size() + points.size()));
  }
  // Write the archive first, so that each journal record has its frame.
  if (!archive.write_parts_at(archive_end, parts)) throw roll_back(archive);
  if (!journal->write_at(journal_end, lines)) throw roll_back(*journal);
  journal_end += lines.size();
  archive_end = end;
  cues.insert(cues.end(), points.begin(), points.end());
  last_stored_time = last_stored;
  if (!frames.empty()) last_time = frames.back().time_ns;
}

void ArchiveWriter::Files::close() {
  // Every intermediate state is readable: first the Cues after the clusters, then the references to
  // them, last the size of the Segment, which marks the file as closed.
  const auto closing = matroska::make_trailer(cues, header, archive_end);
  const auto put = [&](std::uint64_t offset, std::span<const std::byte> bytes) {
    if (!archive.write_at(offset, bytes)) throw roll_back(archive);
  };
  put(archive_end, closing.cues);
  put(header.duration_offset, closing.duration);
  put(header.rate_offset, closing.rate);
  put(header.seek_head_offset, closing.seek_head);
  archive_end += closing.cues.size();
  put(header.segment_size_offset, closing.segment_size);
}

void ArchiveWriter::Files::flush() {
  const auto bring = [](const OutputFile& file) {
    if (file.sync()) return;
    throw Error::from_errno("the data cannot be synced to the disk", file.path().string(),
                            "Check the disk");
  };
  bring(archive);
  archive.uncache();
  bring(*journal);
  // Sync the folder once: otherwise a power loss may leave files that no folder lists.
  if (!directory_is_synced.exchange(true)) {
    sync_folder(archive.path().parent_path());
    sync_folder(journal->path().parent_path());
  }
}

void check_description(const ArchiveWriter::Description& description,
                       const std::filesystem::path& archive) {
  const auto refuse = [&](std::string what) {
    return Error::bad_input(std::move(what), archive.string(), "Correct the camera's description");
  };
  if (description.width <= 0 || description.height <= 0) {
    throw refuse("a camera of " + std::to_string(description.width) + " x " +
                 std::to_string(description.height) + " pixels cannot be recorded");
  }
  if (description.epoch_utc < 0) throw refuse("the epoch is before 1970");
}

}  // namespace raystage::store
