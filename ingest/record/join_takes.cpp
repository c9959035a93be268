// SPDX-License-Identifier: Apache-2.0
// Joins the takes that several nodes recorded of one scene. Frames are copied byte for byte with
// times relative to the earliest epoch, and compared with their hashes. Cost: reads and writes
// every archive once.
#include "ingest/record/join_takes.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"
#include "schemas/recording_document.h"
#include "schemas/rig_document.h"
#include "store/journal_archives.h"
#include "store/matroska.h"
#include "store/recordings.h"
#include "store/take.h"

namespace raystage::ingest {
namespace {

namespace fs = std::filesystem;

struct Part {
  Part(const fs::path& folder, bool documents_only)
      : take(folder, documents_only ? store::make_journal_archives(folder) : nullptr),
        rig(schemas::read_rig(take.file("rig.json"))),
        accounts(folder / "recording") {}
  store::Take take;
  schemas::RigDocument rig;
  fs::path accounts;
};

/// Returns the node whose sessions the part contains, for cameras without a node of their own.
std::string node_of(const Part& part) {
  const std::vector<schemas::RecordingDocument> recordings =
      store::read_recordings(part.take.folder());
  return recordings.empty() ? "" : recordings.back().node;
}

void add_late_node_warnings(const std::vector<Part>& parts, std::vector<std::string>& warnings) {
  for (const Part& part : parts) {
    for (const schemas::RecordingDocument& recording : store::read_recordings(part.take.folder())) {
      for (const schemas::RecordingDocument::Session& session : recording.sessions) {
        if (session.late() == 0) continue;
        warnings.push_back(fmt::format(
            "node {} started {:.3f} s after its start time and has no frames of that time",
            recording.node,
            static_cast<double>(session.late()) / static_cast<double>(kNanosecondsPerSecond)));
      }
    }
  }
}

/// First and last time of a part's frames, in ns since the joined epoch.
struct Span {
  std::string part;
  Nanoseconds begin = std::numeric_limits<Nanoseconds>::max(), end = -1;
  std::string text() const {
    const auto seconds = [](Nanoseconds time) {
      return static_cast<double>(time) / kNanosecondsPerSecond;
    };
    return fmt::format("{} from {:.3f} s to {:.3f} s", part, seconds(begin), seconds(end));
  }
};

/// Returns the spans of all parts that have records. Throws Error (bad input) if one ends after the
/// longest time of a take.
std::vector<Span> spans_of(const std::vector<Part>& parts, Nanoseconds epoch_utc) {
  std::vector<Span> spans;
  for (const Part& part : parts) {
    const Nanoseconds time_shift = part.take.document().epoch_utc - epoch_utc;
    Span span{.part = part.take.folder().string()};
    for (int i = 0; i < part.take.camera_count(); ++i) {
      const auto records = part.take.archive(i).records();
      if (records.empty()) continue;
      span.begin = std::min(span.begin, records.front().time_ns + time_shift);
      span.end = std::max(span.end, records.back().time_ns + time_shift);
    }
    if (span.end > store::matroska::kMaxTime) {
      throw Error::bad_input(
          fmt::format("it ends {:.0f} days after the epoch of the first part, but a take can hold "
                      "104 days",
                      static_cast<double>(span.end) / kNanosecondsPerSecond / 86400),
          span.part, "Use these parts separately; set the nodes' clocks before the next recording");
    }
    if (span.end >= 0) spans.push_back(std::move(span));
  }
  return spans;
}

/// Returns a warning if no instant is in all parts. A gap of up to one frame period is accepted.
std::optional<std::string> gap_warning(const std::vector<Span>& spans, double fps) {
  if (spans.empty()) return {};
  const Span& first_to_end = *std::ranges::min_element(spans, {}, &Span::end);
  const Span& last_to_begin = *std::ranges::max_element(spans, {}, &Span::begin);
  const Nanoseconds gap = last_to_begin.begin - first_to_end.end;
  if (static_cast<double>(gap) * fps <= static_cast<double>(kNanosecondsPerSecond)) return {};
  return fmt::format(
      "the parts do not overlap in time: {}, {}, a gap of {:.3f} s; check the nodes' clocks",
      first_to_end.text(), last_to_begin.text(), static_cast<double>(gap) / kNanosecondsPerSecond);
}

/// Returns the rig of all cameras. Cameras with default poses are placed in one row next to the
/// calibrated ones, so that no two have the same position.
schemas::RigDocument joined_rig(const std::vector<Part>& parts,
                                std::vector<std::string>& warnings) {
  schemas::RigDocument rig;
  rig.name = parts.front().rig.name;
  rig.topology = parts.front().rig.topology;
  double row_end = -schemas::kDefaultCameraSpacing;
  const Part* measured = nullptr;
  const Part* guessed = nullptr;
  for (const Part& part : parts) {
    (schemas::is_calibrated(part.rig) ? measured : guessed) = &part;
    if (!schemas::is_calibrated(part.rig)) continue;
    for (const auto& camera : part.rig.cameras) {
      row_end = std::max(row_end, camera.geometry.world_from_camera[3]);
    }
  }
  for (const Part& part : parts) {
    for (schemas::RigDocument::Camera camera : part.rig.cameras) {
      if (!schemas::is_calibrated(part.rig)) {
        row_end += schemas::kDefaultCameraSpacing;
        camera.geometry.world_from_camera[3] = row_end;
      }
      rig.cameras.push_back(std::move(camera));
    }
  }
  if (guessed != nullptr) rig.name = schemas::kUncalibratedRigName;
  if (guessed != nullptr && measured != nullptr) {
    warnings.push_back(
        fmt::format("the rig of {} is not calibrated, that of {} is: the joined rig counts as not "
                    "calibrated",
                    guessed->take.folder().string(), measured->take.folder().string()));
  }
  return rig;
}

void check_compatible(const Part& part, const Part& first) {
  const schemas::TakeDocument &a = part.take.document(), &b = first.take.document();
  if (a.color_space == b.color_space && a.arbitrary_scale == b.arbitrary_scale) return;
  throw Error::bad_input(
      "the colour space or the scale differs from that of " + first.take.folder().string(),
      part.take.folder().string(), "Join parts of one recording only");
}

/// Returns take.json of the joined take. `keeps_archives`: cameras keep the names and epochs of
/// their archives.
schemas::TakeDocument joined_document(const std::vector<Part>& parts, const std::string& created_by,
                                      bool keeps_archives) {
  schemas::TakeDocument joined = parts.front().take.document();
  joined.created_by = created_by;
  joined.cameras.clear();
  std::set<std::string> ids;
  for (const Part& part : parts) {
    const schemas::TakeDocument& document = part.take.document();
    joined.epoch_utc = std::min(joined.epoch_utc, document.epoch_utc);
    if (document.clock != joined.clock) joined.clock = "host";
    if (document.timestamp_event != joined.timestamp_event) joined.timestamp_event = "unknown";
    const std::string node = node_of(part);
    for (schemas::TakeDocument::Camera camera : document.cameras) {
      if (!ids.insert(camera.id).second) {
        throw Error::bad_input("the camera \"" + camera.id + "\" is in another part too",
                               part.take.folder().string(),
                               "Give the cameras of all nodes different ids");
      }
      if (camera.node.empty()) camera.node = node;
      if (keeps_archives) {
        if (!camera.archive_epoch_utc) camera.archive_epoch_utc = document.epoch_utc;
      } else {
        camera.archive.clear();
        camera.journal.clear();
        camera.archive_epoch_utc = std::nullopt;
      }
      joined.cameras.push_back(std::move(camera));
    }
  }
  for (schemas::TakeDocument::Camera& camera : joined.cameras) {
    if (camera.archive_epoch_utc == joined.epoch_utc) camera.archive_epoch_utc = std::nullopt;
  }
  return joined;
}

store::FrameRecord shifted(store::FrameRecord record, Nanoseconds by) {
  record.time_ns += by;
  if (record.arrival_ns != store::kUnknownTime &&
      __builtin_add_overflow(record.arrival_ns, by, &record.arrival_ns)) {
    record.arrival_ns = store::kUnknownTime;  // journals may state any arrival
  }
  return record;
}

/// Copies the session documents; of two nodes with the same name both are kept.
void copy_accounts(const std::vector<Part>& parts, const fs::path& folder) {
  create_folder(folder);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    std::error_code error;
    for (fs::directory_iterator file(parts[p].accounts, error), end; !error && file != end;
         file.increment(error)) {
      if (file->path().extension() != ".json") continue;
      fs::path target = folder / file->path().filename();
      if (file_exists(target))
        target = folder / fmt::format("part{}_{}", p + 1, file->path().filename().string());
      write_file_atomically(target,
                            read_file(parts[p].take.file("recording" / file->path().filename())));
    }
  }
}

/// Copies the journals under their names, without the archives.
void copy_journals(const std::vector<Part>& parts, const fs::path& folder, JoinReport& report) {
  for (const Part& part : parts) {
    for (int i = 0; i < part.take.camera_count(); ++i) {
      const schemas::TakeDocument::Camera& camera = part.take.document().cameras[i];
      if (camera.archive != "archive/" + camera.id + ".mkv") {
        throw Error::bad_input("the archive of camera \"" + camera.id + "\" is " + camera.archive +
                                   ", not archive/" + camera.id + ".mkv",
                               part.take.folder().string(), "Join the parts with their archives");
      }
      const fs::path target = folder / camera.journal;
      create_folder(target.parent_path());
      write_file_atomically(target, read_file(part.take.file(camera.journal)));
      for (const store::FrameRecord& record : part.take.archive(i).records()) {
        ++(record.status == store::FrameStatus::kStored ? report.frames : report.missing);
      }
      ++report.cameras;
    }
  }
}

}  // namespace

JoinReport join_takes(const std::vector<fs::path>& folders, const fs::path& take_folder,
                      const std::string& created_by, bool documents_only,
                      const std::function<void(double)>& progress, const std::stop_token& stop) {
  std::vector<Part> parts;
  for (const fs::path& folder : folders) parts.emplace_back(folder, documents_only);
  std::uint64_t total = 0;
  for (const Part& part : parts) {
    check_compatible(part, parts.front());
    part.take.check_not_inside(take_folder);
    for (int i = 0; i < part.take.camera_count(); ++i)
      total += part.take.archive(i).records().size();
  }
  const schemas::TakeDocument joined = joined_document(parts, created_by, documents_only);
  JoinReport report;
  const schemas::RigDocument rig = joined_rig(parts, report.warnings);
  add_late_node_warnings(parts, report.warnings);
  if (auto apart = gap_warning(spans_of(parts, joined.epoch_utc), joined.nominal_fps)) {
    report.warnings.push_back(std::move(*apart));
  }
  store::TakeWriter writer(take_folder, joined, rig);
  copy_accounts(parts, writer.working_folder() / "recording");
  if (documents_only) {
    copy_journals(parts, writer.working_folder(), report);
    writer.finish_documents();
    writer.commit();
    if (progress) progress(1);
    report.status = RunStatus::kFinished;
    return report;
  }

  std::uint64_t done = 0;
  for (const Part& part : parts) {
    const Nanoseconds time_shift = part.take.document().epoch_utc - joined.epoch_utc;
    for (int i = 0; i < part.take.camera_count(); ++i) {
      const store::ArchiveReader& from = part.take.archive(i);
      store::ArchiveWriter& to = writer.archive(report.cameras++);
      int frame = 0;
      for (const store::FrameRecord& record : from.records()) {
        if (stop.stop_requested()) {
          throw Error::failed("joining was stopped", take_folder.string(),
                              "Start it again; no take was left behind");
        }
        if (record.status != store::FrameStatus::kStored) {
          to.append_again(shifted(record, time_shift), {});
          ++report.missing;
        } else {
          const auto jpeg = from.stored(frame++);
          to.append_again(shifted(record, time_shift), jpeg);
          ++report.frames;
          report.bytes += jpeg.size();
        }
        if (progress) progress(static_cast<double>(++done) / static_cast<double>(total));
      }
      to.close();
    }
  }
  writer.commit();
  report.status = RunStatus::kFinished;
  return report;
}

}  // namespace raystage::ingest
