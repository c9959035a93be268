// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/recording_take.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "ingest/sources/frame_source.h"
#include "store/matroska.h"
#include "store/stored_frames.h"
#include "store/unlisted_frames.h"

namespace raystage::ingest {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kReservePerCamera = 128 << 10, kReserveAtLeast = 1 << 20,
                       kBlock = 4 << 10;  // block size of common file systems, bytes

/// Returns the name of a node's session document.
std::string file_name_of(const std::string& node) {
  std::string name;
  for (const char c : node) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
    name += plain ? c : '_';
  }
  return (name.empty() ? "node" : name) + ".json";
}

store::ArchiveWriter::Description description_of(
    const schemas::TakeDocument& take, const schemas::RigDocument& rig, std::size_t camera,
    store::FrameCodec codec = store::FrameCodec::kJpeg) {
  const schemas::CameraGeometry& geometry = rig.cameras[camera].geometry;
  return {take.cameras[camera].id, geometry.width, geometry.height, take.epoch_utc, codec};
}

/// Throws Error (bad input) if frames that arrive now have times outside of an archive's range.
void check_epoch(Nanoseconds epoch_utc, const fs::path& folder, const std::string& what_to_do) {
  const Nanoseconds now = host_utc_now();
  const Nanoseconds distance = now > epoch_utc ? now - epoch_utc : epoch_utc - now;
  if (distance <= store::matroska::kMaxTime) return;
  throw Error::bad_input(
      fmt::format("the take's epoch is {}, more than 104 days (the longest time of a take) from "
                  "now ({})",
                  format_utc(epoch_utc), format_utc(now)),
      folder.string(), what_to_do);
}

Error copies_differ(const fs::path& where, const std::string& what) {
  return Error::bad_input("the copies of the take differ: " + what, where.string(),
                          "Run `raystage repair` on each with the other as its copy")
      .concerning({"mirror"});
}

/// Throws Error (bad input) if two documents are not of copies of one take.
void check_same_take(const schemas::TakeDocument& a, const schemas::TakeDocument& b,
                     const fs::path& folder, const fs::path& other) {
  const auto same = [](const auto& x, const auto& y) {
    return x.id == y.id && x.archive == y.archive && x.journal == y.journal;
  };
  if (a.name == b.name && a.epoch_utc == b.epoch_utc &&
      std::ranges::equal(a.cameras, b.cameras, same)) {
    return;
  }
  throw copies_differ(other, "name, epoch or cameras in " + (folder / "take.json").string());
}

store::ArchiveFiles files_of(const fs::path& folder, const schemas::TakeDocument::Camera& camera) {
  return {folder / camera.archive, folder / camera.journal};
}

}  // namespace

RecordingTake::FolderCleanup::~FolderCleanup() {
  if (folder_.empty()) return;
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

RecordingTake::RecordingTake(fs::path folder, schemas::TakeDocument take, schemas::RigDocument rig,
                             const std::string& node)
    : folder_(std::move(folder)),
      take_(std::move(take)),
      rig_(std::move(rig)),
      recording_file_(folder_ / "recording" / file_name_of(node)),
      reserve_file_(folder_ / ".reserve") {
  recording_.node = node;
}

fs::path RecordingTake::archive_path(std::size_t camera) const {
  return folder_ / take_.cameras[camera].archive;
}
fs::path RecordingTake::journal_path(std::size_t camera) const {
  return folder_ / take_.cameras[camera].journal;
}

RecordingTake RecordingTake::create(const fs::path& folder, schemas::TakeDocument take,
                                    const schemas::RigDocument& rig, const std::string& node) {
  const std::vector<store::FrameCodec> codecs(take.cameras.size(), store::FrameCodec::kJpeg);
  return create(folder, std::move(take), rig, node, codecs);
}

RecordingTake RecordingTake::create_copy(const fs::path& folder, const RecordingTake& source) {
  std::vector<store::FrameCodec> codecs;
  for (std::size_t i = 0; i < source.take_.cameras.size(); ++i) {
    const store::ArchiveReader archive(source.archive_path(i), source.journal_path(i));
    codecs.push_back(archive.description().codec);
  }
  return create(folder, source.take_, source.rig_, source.recording_.node, codecs);
}

RecordingTake RecordingTake::create(const fs::path& folder, schemas::TakeDocument take,
                                    const schemas::RigDocument& rig, const std::string& node,
                                    const std::vector<store::FrameCodec>& codecs) {
  for (schemas::TakeDocument::Camera& camera : take.cameras) {
    camera.archive = "archive/" + camera.id + ".mkv";
    camera.journal = "archive/" + camera.id + ".journal";
  }
  schemas::parse_take(schemas::format_take(take),
                      "take.json");  // fails now, not after the last frame
  schemas::parse_rig(schemas::format_rig(rig), "rig.json");
  if (is_name_taken(folder)) {
    throw Error::bad_input("a file or folder of this name already exists", folder.string(),
                           "Choose a new name for the take, or resume this one")
        .concerning({"resume"});
  }
  check_epoch(take.epoch_utc, folder, "Correct the time to start at, or this machine's clock");
  RecordingTake recording(folder, std::move(take), rig, node);
  recording.folder_cleanup_ = FolderCleanup(folder);
  recording.create_files(codecs);
  return recording;
}

void RecordingTake::create_files(const std::vector<store::FrameCodec>& codecs) {
  create_folder(folder_ / "archive");
  create_folder(folder_ / "recording");
  schemas::write_rig(rig_, folder_ / "rig.json");
  for (std::size_t i = 0; i < take_.cameras.size(); ++i) {
    archives_.emplace_back(archive_path(i), journal_path(i),
                           description_of(take_, rig_, i, codecs[i]));
    last_times_.push_back(-1);
  }
  // Written last, because it makes the folder a take.
  schemas::write_take(take_, folder_ / "take.json");
}

RecordingTake RecordingTake::resume(const fs::path& folder,
                                    const std::vector<std::string>& camera_ids,
                                    const std::string& node, const fs::path& other) {
  RecordingTake recording(folder, schemas::read_take(ContainedPath{folder, "take.json"}),
                          schemas::read_rig(ContainedPath{folder, "rig.json"}), node);
  std::vector<std::string> there;
  for (const schemas::TakeDocument::Camera& camera : recording.take_.cameras)
    there.push_back(camera.id);
  if (there != camera_ids) {
    throw Error::bad_input(
        fmt::format("the take has {} cameras, the configuration {}, or they differ in id or order",
                    there.size(), camera_ids.size()),
        (folder / "take.json").string(), "Resume with the configuration that started the take");
  }
  check_epoch(recording.take_.epoch_utc, folder,
              "Record into a new take, or correct this machine's clock");
  recording.require_contained_files();
  if (!other.empty()) {
    recording.compare_with(other, schemas::read_take(ContainedPath{other, "take.json"}));
  }
  create_folder(folder / "recording");
  if (file_exists(recording.recording_file_)) {
    recording.recording_ = schemas::read_recording(
        ContainedPath{folder, recording.recording_file_.lexically_relative(folder)});
  }
  for (std::size_t i = 0; i < there.size(); ++i) {
    const fs::path archive = recording.archive_path(i), journal = recording.journal_path(i);
    const schemas::TakeDocument::Camera& camera = recording.take_.cameras[i];
    if (!other.empty()) store::complete_journal({archive, journal}, files_of(other, camera));
    recording.archives_.push_back(store::ArchiveWriter::resume(
        archive, journal, description_of(recording.take_, recording.rig_, i)));
    const store::ArchiveReader reader(recording.archive_path(i), recording.journal_path(i));
    recording.last_times_.push_back(reader.records().empty() ? -1
                                                             : reader.records().back().time_ns);
  }
  return recording;
}

void RecordingTake::compare_with(const fs::path& other, const schemas::TakeDocument& there) const {
  check_same_take(take_, there, folder_, other);
  for (const schemas::TakeDocument::Camera& camera : take_.cameras) {
    for (const std::string& file : {camera.archive, camera.journal}) {
      require_contained({other, file});
    }
    const store::ArchiveFiles own_files = files_of(folder_, camera);
    const store::ArchiveFiles other_files = files_of(other, camera);
    store::CopyRecords own = store::read_copy_records(own_files);
    const store::CopyRecords copy = store::read_copy_records(other_files);
    const auto check_journal = [](const store::CopyRecords& records, const store::CopyRecords& more,
                                  const fs::path& journal) {
      if (records.has_journal || more.records.empty()) return;
      throw copies_differ(journal, "the journal is missing or its header is damaged");
    };
    check_journal(own, copy, own_files.journal);
    check_journal(copy, own, other_files.journal);
    // As resume() of both will leave them.
    const auto completed = store::complete_records(own, copy);
    if (completed) {
      own.records = *completed;
      own.listed = completed->size();
    }
    const auto completed_copy = completed ? store::complete_records(copy, own) : std::nullopt;
    if (!completed_copy) {
      throw copies_differ(own_files.archive, "the records of camera \"" + camera.id + "\"");
    }
  }
}

void RecordingTake::require_contained_files() const {
  std::vector<fs::path> files{"take.json", "rig.json", reserve_file_.filename(),
                              recording_file_.lexically_relative(folder_)};
  for (const schemas::TakeDocument::Camera& camera : take_.cameras) {
    files.emplace_back(camera.archive);
    files.emplace_back(camera.journal);
  }
  for (const fs::path& file : files) require_contained({folder_, file});
}

std::size_t RecordingTake::complete_from(const RecordingTake& other) {
  std::size_t appended = 0;
  check_same_take(take_, other.take_, folder_, other.folder_);
  for (std::size_t i = 0; i < take_.cameras.size(); ++i) {
    const store::ArchiveReader own(archive_path(i), journal_path(i));
    const store::ArchiveReader theirs(other.archive_path(i), other.journal_path(i));
    const auto have = own.records(), wanted = theirs.records();
    const std::size_t common = std::min(have.size(), wanted.size());
    if (!std::ranges::equal(have.first(common), wanted.first(common), store::is_same_record)) {
      throw copies_differ(other.folder_, "the records of camera \"" + take_.cameras[i].id + "\"");
    }
    const store::StoredFrames stored(other.archive_path(i));
    for (const store::FrameRecord& record : wanted.subspan(common)) {
      if (record.status == store::FrameStatus::kStored) {
        archives_[i].append_again(record, stored.read(record));
      } else {
        archives_[i].append_again(record, {});
      }
      last_times_[i] = record.time_ns;
      ++appended;
    }
  }
  if (other.recording_.sessions.size() > recording_.sessions.size()) {
    recording_ = other.recording_;
  }
  return appended;
}

void RecordingTake::write_session(const schemas::RecordingDocument::Session& session, bool first) {
  if (first) {
    recording_.sessions.push_back(session);
  } else {
    recording_.sessions.back() = session;
  }
  schemas::write_recording(recording_, recording_file_);
  folder_cleanup_.keep();
}

void RecordingTake::reserve_disk_space() {
  const FileDescriptor file =
      open_contained({folder_, reserve_file_.filename()}, O_WRONLY | O_CREAT, 0666);
  struct stat status {};
  if (!file.open() || fstat(file.number(), &status) != 0) {
    throw Error::from_errno("the file cannot be written", reserve_file_.string(),
                            "Check the folder's permissions");
  }
  if (!S_ISREG(status.st_mode)) {
    throw Error::failed("this is no regular file", reserve_file_.string(), "Remove it");
  }
  auto bytes = std::max<std::int64_t>(
      kReserveAtLeast, kReservePerCamera * static_cast<std::int64_t>(take_.cameras.size()));
  // On a nearly full disk the reserve is as large as possible. If the file system cannot allocate
  // space, the recording continues without a reserve.
  while (::posix_fallocate(file.number(), 0, bytes) == ENOSPC && bytes > kBlock) bytes /= 2;
}

void RecordingTake::release_disk_space() {
  std::error_code ignored;
  fs::remove(reserve_file_, ignored);
}

void RecordingTake::close(std::vector<std::string>& problems) {
  release_disk_space();
  for (store::ArchiveWriter& archive : archives_) {
    try {
      archive.flush();
      archive.close();
    } catch (const Error& error) {
      problems.emplace_back(error.what());
    }
  }
}

RecordingTake::RecordCounts RecordingTake::count(std::size_t camera) const {
  RecordCounts counted;
  const store::ArchiveReader reader(archive_path(camera), journal_path(camera));
  for (const store::FrameRecord& record : reader.records()) {
    if (record.time_ns <= last_times_[camera]) continue;
    ++counted.by_status[static_cast<std::size_t>(record.status)];
  }
  return counted;
}

}  // namespace raystage::ingest
