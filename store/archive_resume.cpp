// SPDX-License-Identifier: Apache-2.0
// Opens an existing archive and journal to append to them. Determines the expected journal from
// both files (archive_index.h) and undoes close() in the reverse order, so that a crash at any
// moment leaves readable files. Cost: reads the journal, and only those frames that it lacks or
// that are at the end.
#include <xxhash.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/mapped_file.h"
#include "store/archive_index.h"
#include "store/archive_writer_files.h"
#include "store/journal.h"

namespace raystage::store {
namespace {

using Bytes = std::span<const std::byte>;
using Description = ArchiveWriter::Description;

Error damaged_header(const std::filesystem::path& path) {
  return Error::bad_input("the archive's header is damaged", path.string() + " @0",
                          "Run `raystage repair` on the take");
}

void check_header(Bytes file, const matroska::Header& header, const Description& wanted,
                  const Description& found, const std::filesystem::path& path) {
  if (matroska::begins_with(file, header)) return;
  if (!found.camera_id.empty() &&
      (found.camera_id != wanted.camera_id || found.width != wanted.width ||
       found.height != wanted.height || found.epoch_utc != wanted.epoch_utc)) {
    throw Error::bad_input(
        "the archive is of camera \"" + found.camera_id + "\", " + std::to_string(found.width) +
            " x " + std::to_string(found.height) + " pixels, epoch " + format_utc(found.epoch_utc) +
            ", but camera \"" + wanted.camera_id + "\", " + std::to_string(wanted.width) + " x " +
            std::to_string(wanted.height) + ", " + format_utc(wanted.epoch_utc) + " is expected",
        path.string(), "Resume the archive of that camera, or begin a new take");
  }
  throw damaged_header(path);
}

/// Throws Error (bad input) unless a frame that was found without its record is in a cluster as
/// ArchiveWriter writes it: records and cues can describe no other.
void require_own_cluster(Bytes archive, const FrameRecord& frame,
                         const std::filesystem::path& path) {
  const auto offset = static_cast<std::size_t>(frame.offset);  // after the header: see has_space
  const auto own = matroska::parse_cluster(archive, offset - matroska::kClusterHeaderBytes);
  if (own && own->time == frame.time_ns && own->offset == offset && own->size == frame.size) return;
  throw Error::bad_input("a frame without a record is not stored as Raystage stores frames",
                         path.string() + " @" + std::to_string(offset),
                         "Run `raystage repair` on the take");
}

struct Found {
  ArchiveIndex index;
  std::vector<std::byte> journal;  ///< its expected bytes
  bool journal_is_right = false, header_is_whole = false;
};

Found examine(Bytes archive, std::optional<Bytes> journal_bytes,
              const std::filesystem::path& archive_path, const std::filesystem::path& journal_path,
              const Description& description, const matroska::Header& header) {
  Found found;
  found.index = index_archive(archive, journal_bytes, archive_path.string(), journal_path.string());
  check_header(archive, header, description, found.index.description, archive_path);
  // A frame in the space of the header would be overwritten when the archive is closed.
  const bool has_space = std::ranges::all_of(found.index.frames, [&](const FrameRecord& frame) {
    return frame.offset >= header.bytes.size() + matroska::kClusterHeaderBytes;
  });
  if (!has_space) throw damaged_header(archive_path);
  found.header_is_whole = archive.size() >= header.bytes.size();

  const auto add = [&](const auto& bytes) {
    found.journal.insert(found.journal.end(), bytes.begin(), bytes.end());
  };
  add(journal::encode_header(description));
  for (FrameRecord& record : found.index.records) {
    if (record.status == FrameStatus::kStored && record.xxh3 == 0) {
      require_own_cluster(archive, record, archive_path);
      record.xxh3 = XXH3_64bits(archive.data() + record.offset, record.size);
    }
    add(journal::encode_record(record));
  }
  found.journal_is_right = journal_bytes && std::ranges::equal(*journal_bytes, found.journal);
  return found;
}

Found examine_files(const std::filesystem::path& archive_path,
                    const std::filesystem::path& journal_path, const Description& description,
                    const matroska::Header& header) {
  const MappedFile archive(archive_path);
  const auto examine_with = [&](std::optional<Bytes> journal) {
    return examine(archive.bytes(), journal, archive_path, journal_path, description, header);
  };
  if (!exists(ContainedPath{journal_path.parent_path(), journal_path.filename()})) {
    return read_mapped([&] { return examine_with(std::nullopt); }, archive);
  }
  const MappedFile journal(journal_path);
  return read_mapped([&] { return examine_with(journal.bytes()); }, archive, journal);
}

matroska::Header header_of(const std::filesystem::path& archive_path,
                           const Description& description) {
  const MappedFile archive(archive_path);
  return read_mapped([&] { return matroska::header_of_file(archive.bytes(), description); },
                     archive);
}

}  // namespace

ArchiveWriter::Files::Files(Existing, const std::filesystem::path& archive_path,
                            const Description& description)
    : archive(archive_path, OutputFile::Open::kExisting),
      header(header_of(archive_path, description)) {}

ArchiveWriter ArchiveWriter::resume(const std::filesystem::path& archive,
                                    const std::filesystem::path& journal,
                                    const Description& description) {
  check_description(description, archive);
  if (!file_exists(archive)) {
    throw Error::bad_input("the archive to resume does not exist", archive.string(),
                           "Begin a new recording");
  }
  auto files = std::make_unique<Files>(Files::Existing{}, archive, description);
  const matroska::Header& header = files->header;
  if (is_temporal(header.codec)) {
    throw Error::bad_input("the archive holds HEVC or AV1, to which no JPEG can be added",
                           archive.string(), "Begin a new recording");
  }
  Found found = examine_files(archive, journal, description, header);
  if (found.header_is_whole && !found.index.lost.empty()) {
    throw Error::bad_input("the archive is shorter than when it was closed: " +
                               std::to_string(found.index.lost.size()) + " frames are lost",
                           archive.string(),
                           "Run `raystage repair --from COPY` on the take, or `raystage repair` to "
                           "go on without them");
  }
  files->archive_end = header.bytes.size();
  for (const FrameRecord& frame : found.index.frames) {
    files->cues.push_back({frame.time_ns, frame.offset - matroska::kClusterHeaderBytes});
    files->archive_end = frame.offset + frame.size;
    files->last_stored_time = frame.time_ns;
  }
  if (!found.index.records.empty()) files->last_time = found.index.records.back().time_ns;

  const auto check = [&](bool done) {
    if (!done) {
      throw Error::from_errno("the archive cannot be reopened", archive.string(),
                              "Check the disk and its free space");
    }
  };
  const auto put_back = [&](std::size_t offset, std::size_t size) {
    check(files->archive.write_at(offset, Bytes(header.bytes).subspan(offset, size)));
  };
  if (found.header_is_whole) {
    // Undo close() in reverse: first the size that marks the file as closed, then the references to
    // the Cues. Remove the Cues only after these are on disk. Every state in between can be read.
    put_back(header.segment_size_offset, header.segment_data_offset - header.segment_size_offset);
    put_back(header.seek_head_offset, matroska::kSeekHeadBytes);
    put_back(header.duration_offset, matroska::kDurationBytes);
    if (header.rate_offset > 0) put_back(header.rate_offset, matroska::kRateBytes);
  } else {
    put_back(0, header.bytes.size());
  }
  check(files->archive.sync() && files->archive.truncate(files->archive_end));
  if (!found.journal_is_right) write_file_atomically(journal, found.journal);
  files->journal = std::make_unique<OutputFile>(journal, OutputFile::Open::kExisting);
  files->journal_end = found.journal.size();
  return ArchiveWriter(std::move(files));
}

}  // namespace raystage::store
