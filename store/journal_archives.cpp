// SPDX-License-Identifier: Apache-2.0
#include "store/journal_archives.h"

#include <string>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "store/journal.h"
#include "store/matroska.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

class FramesElsewhere : public RemoteFrames {
 public:
  explicit FramesElsewhere(std::string archive) : archive_(std::move(archive)) {}
  FrameBytes jpeg(int) const override { throw elsewhere(); }
  JpegLayout layout(int) const override { throw elsewhere(); }
  FrameBytes jpeg_part(int, const JpegLayout&, const McuMask&) const override { throw elsewhere(); }

 private:
  Error elsewhere() const {
    return Error::bad_input("the archive is not on this host, only its journal", archive_,
                            "Run this on the host that has the archive");
  }
  std::string archive_;
};

/// Drops records that contradict those before, or have times that no archive has, as
/// index_archive() does.
void drop_unordered(std::vector<FrameRecord>& records) {
  Nanoseconds last = 0, last_stored = -1;
  std::erase_if(records, [&](const FrameRecord& record) {
    const bool is_stored = record.status == FrameStatus::kStored;
    if (record.time_ns < last || record.time_ns > matroska::kMaxTime ||
        (is_stored && record.time_ns <= last_stored)) {
      return true;
    }
    last = record.time_ns;
    if (is_stored) last_stored = last;
    return false;
  });
}

class JournalArchives : public RemoteArchives {
 public:
  explicit JournalArchives(fs::path folder)
      : folder_(std::move(folder)),
        document_(schemas::read_take(ContainedPath{folder_, "take.json"})) {}

  std::optional<ArchiveReader> open(int camera) const override {
    const schemas::TakeDocument::Camera& entry = document_.cameras[camera];
    const fs::path archive = folder_ / entry.archive, journal = folder_ / entry.journal;
    const ContainedPath journal_file{folder_, entry.journal};
    if (exists(ContainedPath{folder_, entry.archive}) || !exists(journal_file)) return std::nullopt;
    const MappedFile file(journal_file);
    journal::Contents contents =
        read_mapped([&] { return journal::decode(file.bytes(), journal.string()); }, file);
    drop_unordered(contents.records);
    const Nanoseconds epoch = entry.archive_epoch_utc.value_or(document_.epoch_utc);
    if (!contents.header || contents.header->camera_hash != journal::hash_camera_id(entry.id) ||
        contents.header->epoch_utc != epoch) {
      throw Error::bad_input("the journal is damaged or not of camera \"" + entry.id + "\"",
                             journal.string(), "Copy it from the host that has the archive");
    }
    ArchiveReader reader({entry.id, 0, 0, epoch}, contents.records,
                         std::make_shared<const FramesElsewhere>(archive.string()));
    reader.shift_times(epoch - document_.epoch_utc);
    return reader;
  }

  bool is_missing(int /*camera*/) const override { return false; }

 private:
  fs::path folder_;
  schemas::TakeDocument document_;
};

}  // namespace

std::shared_ptr<const RemoteArchives> make_journal_archives(const fs::path& take_folder) {
  if (!file_exists(take_folder / "take.json")) return nullptr;  // Take reports the error
  return std::make_shared<const JournalArchives>(take_folder);
}

}  // namespace raystage::store
