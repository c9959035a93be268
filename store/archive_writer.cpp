// SPDX-License-Identifier: Apache-2.0
#include <xxhash.h>

#include <cerrno>
#include <limits>
#include <system_error>
#include <utility>

#include "schemas/error.h"
#include "store/archive_files.h"
#include "store/journal.h"

namespace raystage {
namespace {

constexpr const char* kMakeRoom = "Make room on the disk or choose another one";

}  // namespace

const char* name_of(FrameStatus status) {
  switch (status) {
    case FrameStatus::kStored:
      return "stored";
    case FrameStatus::kDroppedBySource:
      return "dropped by the source";
    case FrameStatus::kDroppedRamFull:
      return "dropped, memory full";
    case FrameStatus::kDroppedEncoder:
      return "dropped, encoding failed";
    case FrameStatus::kTorn:
      return "torn";
    case FrameStatus::kStartUp:
      return "lost at start-up";
    case FrameStatus::kDroppedDiskFull:
      return "dropped, could not be written";
    case FrameStatus::kDroppedLate:
      return "dropped, arrived out of order";
    case FrameStatus::kUnreadable:
      return "no JPEG or of another size";
  }
  return "unknown";
}

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

void ArchiveWriter::Files::check_time(Nanoseconds time, bool stored) const {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input(what, archive.path().string(),
                            "Give each frame its time since the take's epoch, in order");
  };
  if (time < 0 || time > matroska::kMaxTime) {
    throw refuse("a frame at " + std::to_string(time) +
                 " ns is outside of 0 to 104 days since the epoch");
  }
  const Nanoseconds last = stored && last_stored_time == last_time ? last_time + 1 : last_time;
  if (time < last) {
    throw refuse("a frame at " + std::to_string(time) + " ns does not follow the one at " +
                 std::to_string(last_time) + " ns");
  }
}

Error ArchiveWriter::Files::roll_back(const OutputFile& failed) {
  const std::string reason = std::generic_category().message(errno);
  const bool clean = archive.truncate(archive_end) && journal->truncate(journal_end);
  return Error::failed(
      "writing failed: " + reason +
          (clean ? "; the archive ends with its last whole frame, number " +
                       std::to_string(cues.size())
                 : std::string("; a torn frame may stand at the archive's end, readers skip it")),
      failed.path().string(), kMakeRoom);
}

void ArchiveWriter::Files::append(const FrameRecord& record, std::span<const std::byte> jpeg) {
  // The archive first: a journal record then always has its frame.
  if (!jpeg.empty()) {
    const auto cluster = matroska::make_cluster_header(record.time_ns, jpeg.size());
    if (!archive.write_at(archive_end, cluster, jpeg)) throw roll_back(archive);
  }
  const auto line = journal::encode_record(record);
  if (!journal->write_at(journal_end, line)) throw roll_back(*journal);
  journal_end += line.size();
  if (!jpeg.empty()) {
    cues.push_back({record.time_ns, archive_end});
    archive_end = record.offset + record.size;
    last_stored_time = record.time_ns;
  }
  last_time = record.time_ns;
}

void ArchiveWriter::Files::close() {
  // Every state on the way is readable: Cues behind the clusters, then what points to them, the
  // Segment's size (which says "closed") last.
  const auto closing = matroska::make_closing(cues, header, archive_end);
  const auto put = [&](std::uint64_t offset, std::span<const std::byte> bytes) {
    if (!archive.write_at(offset, bytes)) throw roll_back(archive);
  };
  put(archive_end, closing.cues);
  put(header.duration_offset, closing.duration);
  put(header.seek_head_offset, closing.seek_head);
  archive_end += closing.cues.size();
  put(header.segment_size_offset, closing.segment_size);
}

void ArchiveWriter::Files::flush() {
  const auto bring = [](const OutputFile& file) {
    if (file.sync()) return;
    throw Error::from_errno("the data cannot be brought to the disk", file.path().string(),
                            "Check the disk");
  };
  bring(archive);
  bring(*journal);
  // Once: the files' names, or a power loss leaves files that no folder lists.
  if (!names_are_safe.exchange(true)) {
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
  if (description.epoch_utc < 0) throw refuse("the epoch lies before 1970");
}

ArchiveWriter::ArchiveWriter(const std::filesystem::path& archive,
                             const std::filesystem::path& journal, const Description& description) {
  check_description(description, archive);
  files_ = std::make_unique<Files>(archive, journal, description);
}

ArchiveWriter::ArchiveWriter(std::unique_ptr<Files> files) : files_(std::move(files)) {}

ArchiveWriter::~ArchiveWriter() {
  try {
    close();
  } catch (const Error&) {  // The frames are on disk all the same; see close().
  }
}

ArchiveWriter::ArchiveWriter(ArchiveWriter&&) noexcept = default;

ArchiveWriter& ArchiveWriter::operator=(ArchiveWriter&& other) noexcept {
  ArchiveWriter closes_the_old(std::move(*this));
  files_ = std::move(other.files_);
  return *this;
}

ArchiveWriter::Files& ArchiveWriter::open_files() const {
  if (!files_) throw Error::failed("a frame came after the archive was closed", "", "");
  return *files_;
}

void ArchiveWriter::append(std::span<const std::byte> jpeg, Nanoseconds time, FrameOrigin origin) {
  Files& files = open_files();
  files.check_time(time, true);
  if (jpeg.empty() || jpeg.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw Error::bad_input("a frame of " + std::to_string(jpeg.size()) + " bytes cannot be stored",
                           files.archive.path().string(),
                           "Record what is missing as missing; a frame has 1 byte to 4 GiB");
  }
  files.append({time, files.archive_end + matroska::kClusterHeaderBytes,
                static_cast<std::uint32_t>(jpeg.size()), FrameStatus::kStored,
                XXH3_64bits(jpeg.data(), jpeg.size()), origin.arrival_ns, origin.sequence},
               jpeg);
}

void ArchiveWriter::append_missing(FrameStatus status, Nanoseconds time, FrameOrigin origin) {
  Files& files = open_files();
  files.check_time(time, false);
  if (status == FrameStatus::kStored) {
    throw Error::bad_input("a missing frame needs the reason why it is missing",
                           files.journal->path().string(), "Give another status than stored");
  }
  files.append({time, 0, 0, status, 0, origin.arrival_ns, origin.sequence}, {});
}

Nanoseconds ArchiveWriter::last_time() const { return open_files().last_time; }

void ArchiveWriter::flush() { open_files().flush(); }

void ArchiveWriter::close() {
  // Closed even if that fails: trying again would not get further.
  if (const auto files = std::exchange(files_, nullptr)) files->close();
}

}  // namespace raystage
