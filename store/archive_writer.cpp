// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include "store/archive_writer_files.h"

namespace raystage::store {

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
    case FrameStatus::kDroppedMemoryCeiling:
      return "dropped, memory ceiling";
  }
  return "unknown";
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
  } catch (const Error&) {  // The frames are on disk anyway; see close().
  }
}

ArchiveWriter::ArchiveWriter(ArchiveWriter&&) noexcept = default;

ArchiveWriter& ArchiveWriter::operator=(ArchiveWriter&& other) noexcept {
  ArchiveWriter closes_the_old(std::move(*this));
  files_ = std::move(other.files_);
  return *this;
}

ArchiveWriter::Files& ArchiveWriter::open_files() const {
  if (!files_) throw Error::failed("a frame was appended after the archive was closed", "", "");
  return *files_;
}

void ArchiveWriter::append(std::span<const NewFrame> frames) { open_files().append(frames); }

void ArchiveWriter::append(std::span<const std::byte> jpeg, Nanoseconds time, FrameOrigin origin) {
  const NewFrame frame{time, jpeg, FrameStatus::kStored, origin};
  append(std::span(&frame, 1));
}

void ArchiveWriter::append_missing(FrameStatus status, Nanoseconds time, FrameOrigin origin) {
  if (status == FrameStatus::kStored) {
    throw Error::bad_input("a missing frame has the status of a stored one",
                           open_files().journal->path().string(),
                           "Give the reason why it is missing as its status");
  }
  const NewFrame frame{time, {}, status, origin};
  append(std::span(&frame, 1));
}

void ArchiveWriter::append_again(const FrameRecord& record, std::span<const std::byte> jpeg) {
  const NewFrame frame{record.time_ns,
                       jpeg,
                       record.status,
                       {record.arrival_ns, record.sequence},
                       record.is_unverified};
  append(std::span(&frame, 1));
}

Nanoseconds ArchiveWriter::last_time() const { return open_files().last_time; }

void ArchiveWriter::flush() { open_files().flush(); }

void ArchiveWriter::close() {
  // Closed even if that fails: a second try would fail too.
  if (const auto files = std::exchange(files_, nullptr)) files->close();
}

}  // namespace raystage::store
