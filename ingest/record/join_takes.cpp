// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/join_takes.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "schemas/atomic_file.h"
#include "schemas/error.h"
#include "schemas/recording_document.h"
#include "schemas/rig_document.h"
#include "store/take.h"

namespace raystage {
namespace {

namespace fs = std::filesystem;

struct Part {
  explicit Part(const fs::path& folder)
      : take(folder), rig(read_rig(folder / "rig.json")), accounts(folder / "recording") {}
  Take take;
  RigDocument rig;
  fs::path accounts;
};

/// The node of a part's cameras: their own, or the one whose account the part holds.
std::string node_of(const Part& part) {
  std::string node;
  std::error_code error;
  for (const auto& file : fs::directory_iterator(part.accounts, error)) {
    if (file.path().extension() == ".json") node = read_recording(file.path()).node;
  }
  return node;
}

void check_alike(const Part& part, const Part& first) {
  const TakeDocument &a = part.take.document(), &b = first.take.document();
  if (a.color_space == b.color_space && a.arbitrary_scale == b.arbitrary_scale) return;
  throw Error::bad_input(
      "colour space or scale differ from those of " + first.take.folder().string(),
      part.take.folder().string(), "Join parts of one recording only");
}

TakeDocument joined_document(const std::vector<Part>& parts, const std::string& created_by) {
  TakeDocument joined = parts.front().take.document();
  joined.created_by = created_by;
  joined.cameras.clear();
  std::set<std::string> ids;
  for (const Part& part : parts) {
    const TakeDocument& document = part.take.document();
    joined.epoch_utc = std::min(joined.epoch_utc, document.epoch_utc);
    if (document.clock != joined.clock) joined.clock = "host";
    if (document.time_marks != joined.time_marks) joined.time_marks = "unknown";
    const std::string node = node_of(part);
    for (TakeDocument::Camera camera : document.cameras) {
      if (!ids.insert(camera.id).second) {
        throw Error::bad_input("the camera \"" + camera.id + "\" is in another part too",
                               part.take.folder().string(),
                               "Give the cameras of all nodes different ids");
      }
      if (camera.node.empty()) camera.node = node;
      camera.archive.clear();
      camera.journal.clear();
      joined.cameras.push_back(std::move(camera));
    }
  }
  return joined;
}

FrameOrigin moved(const FrameRecord& record, Nanoseconds by) {
  const bool known = record.arrival_ns != kUnknownTime;
  return {known ? record.arrival_ns + by : kUnknownTime, record.sequence};
}

/// Copies the accounts; two nodes of one name keep both.
void copy_accounts(const std::vector<Part>& parts, const fs::path& folder) {
  create_folder(folder);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    std::error_code error;
    for (const auto& file : fs::directory_iterator(parts[p].accounts, error)) {
      if (file.path().extension() != ".json") continue;
      fs::path target = folder / file.path().filename();
      if (fs::exists(target))
        target = folder / fmt::format("part{}_{}", p + 1, file.path().filename().string());
      write_file_atomically(target, read_file(file.path()));
    }
  }
}

}  // namespace

JoinReport join_takes(const std::vector<fs::path>& folders, const fs::path& take_folder,
                      const std::string& created_by, const std::function<void(double)>& progress,
                      const std::stop_token& stop) {
  std::vector<Part> parts;
  for (const fs::path& folder : folders) parts.emplace_back(folder);
  std::uint64_t total = 0;
  RigDocument rig;
  rig.name = parts.front().rig.name;
  rig.topology = parts.front().rig.topology;
  for (const Part& part : parts) {
    check_alike(part, parts.front());
    rig.cameras.insert(rig.cameras.end(), part.rig.cameras.begin(), part.rig.cameras.end());
    for (int i = 0; i < part.take.camera_count(); ++i)
      total += part.take.archive(i).records().size();
  }
  const TakeDocument joined = joined_document(parts, created_by);
  TakeWriter writer(take_folder, joined, rig);
  copy_accounts(parts, writer.working_folder() / "recording");

  JoinReport report;
  std::uint64_t done = 0;
  for (const Part& part : parts) {
    const Nanoseconds move_by = part.take.document().epoch_utc - joined.epoch_utc;
    for (int i = 0; i < part.take.camera_count(); ++i) {
      const ArchiveReader& from = part.take.archive(i);
      ArchiveWriter& to = writer.archive(report.cameras++);
      int frame = 0;
      for (const FrameRecord& record : from.records()) {
        if (stop.stop_requested()) {
          throw Error::failed("joining was stopped", take_folder.string(),
                              "Start it again; no take was left behind");
        }
        if (record.status != FrameStatus::kStored) {
          to.append_missing(record.status, record.time_ns + move_by, moved(record, move_by));
          ++report.missing;
        } else {
          if (record.xxh3 != 0 && !from.verify_frame(frame)) {
            throw Error::bad_input(
                fmt::format("frame {} of camera \"{}\" is damaged: its hash is another", frame,
                            part.take.document().cameras[static_cast<std::size_t>(i)].id),
                part.take.folder().string(), "Run raystage verify, and raystage repair on it");
          }
          const auto jpeg = from.jpeg(frame++);
          to.append(jpeg, record.time_ns + move_by, moved(record, move_by));
          ++report.frames;
          report.bytes += jpeg.size();
        }
        if (progress) progress(static_cast<double>(++done) / static_cast<double>(total));
      }
      to.close();
    }
  }
  writer.commit();
  return report;
}

}  // namespace raystage
