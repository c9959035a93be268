// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/record_setup.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/frame_rate.h"
#include "store/matroska.h"

namespace raystage::ingest {
namespace {

store::JpegEncodeOptions::Chroma chroma_of(const schemas::RecordConfig& config) {
  switch (config.chroma) {
    case schemas::RecordConfig::Chroma::k444:
      return store::JpegEncodeOptions::Chroma::k444;
    case schemas::RecordConfig::Chroma::k422:
      return store::JpegEncodeOptions::Chroma::k422;
    case schemas::RecordConfig::Chroma::k420:
      break;
  }
  return store::JpegEncodeOptions::Chroma::k420;
}

/// Returns camera `index` of a row with 10 cm spacing and a field of view of 53 degrees. A take
/// needs a rig; calibration replaces this one.
schemas::CameraGeometry uncalibrated(const std::string& id, const SourceDescription& source,
                                     std::size_t index) {
  schemas::CameraGeometry geometry;
  geometry.id = id;
  geometry.width = source.width;
  geometry.height = source.height;
  geometry.intrinsics.fx = geometry.intrinsics.fy = source.width;
  geometry.intrinsics.cx = source.width / 2.0;
  geometry.intrinsics.cy = source.height / 2.0;
  geometry.world_from_camera = {
      1, 0, 0, schemas::kDefaultCameraSpacing * static_cast<double>(index),
      0, 1, 0, 0,
      0, 0, 1, 0,
      0, 0, 0, 1};
  return geometry;
}

auto find_camera(const schemas::RigDocument& rig, const std::string& id) {
  return std::ranges::find(rig.cameras, id,
                           [](const auto& candidate) { return candidate.geometry.id; });
}

void check_size(const schemas::CameraGeometry& geometry, const RecorderCamera& camera,
                const std::filesystem::path& file, const std::string& what_to_do) {
  const SourceDescription& source = camera.source->description();
  if (geometry.width == source.width && geometry.height == source.height) return;
  throw Error::bad_input(
      fmt::format("camera \"{}\" is {} x {} pixels, but its source delivers {} x {}", camera.id,
                  geometry.width, geometry.height, source.width, source.height),
      file.string(), what_to_do);
}

/// Throws Error (bad input) if the recording is not within the 104 days after the take's epoch.
void check_times(const schemas::TakeDocument& take, std::optional<Nanoseconds> start_utc,
                 std::optional<double> duration_s, const std::filesystem::path& file) {
  const Nanoseconds epoch = take.epoch_utc;
  if (start_utc && *start_utc < epoch) {
    throw Error::bad_input(fmt::format("the start time {} is before the take's epoch {}",
                                       format_utc(*start_utc), format_utc(epoch)),
                           file.string(), "Start at the epoch or later, or record into a new take");
  }
  const double from = static_cast<double>(start_utc.value_or(host_utc_now()) - epoch) * 1e-9;
  const double until = from + duration_s.value_or(0);
  if (until <= static_cast<double>(store::matroska::kMaxTime) * 1e-9) return;
  constexpr double kDay = 86400;
  throw Error::bad_input(
      fmt::format("the recording would end {:.1f} days after the take's epoch {}, but a take can "
                  "hold 104 days",
                  until / kDay, format_utc(epoch)),
      file.string(), "Record into a new take, or start earlier");
}

/// Returns the property if it is the same for all sources, otherwise `otherwise`.
std::string common(const std::vector<RecorderCamera>& cameras, std::string SourceDescription::*word,
                   const std::string& otherwise) {
  const std::string& first = cameras.front().source->description().*word;
  const bool same = std::ranges::all_of(
      cameras, [&](const auto& camera) { return camera.source->description().*word == first; });
  return same ? first : otherwise;
}

}  // namespace

RecorderOptions make_recorder_options(const schemas::RecordConfig& config) {
  constexpr double kBytesPerMb = 1e6;
  RecorderOptions settings;
  settings.memory_bytes = static_cast<std::size_t>(config.memory_mb * kBytesPerMb);
  settings.hold = config.hold;
  settings.drop_oldest = config.when_full == schemas::RecordConfig::OverflowPolicy::kDropOldest;
  settings.when_lost = config.when_lost;
  settings.lost_after =
      std::chrono::milliseconds(static_cast<std::int64_t>(config.lost_after_seconds * 1000));
  settings.jpeg = {config.quality, chroma_of(config), config.restart_interval};
  return settings;
}

schemas::RigDocument make_recording_rig(const schemas::RecordConfig& config,
                                        const std::filesystem::path& config_folder,
                                        const std::vector<RecorderCamera>& cameras) {
  schemas::RigDocument rig;
  if (config.rig.empty()) {
    rig.name = schemas::kUncalibratedRigName;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      rig.cameras.push_back({uncalibrated(cameras[i].id, cameras[i].source->description(), i), {}});
    }
    return rig;
  }
  const std::filesystem::path file = config_folder / config.rig;
  const schemas::RigDocument whole = schemas::read_rig(file);
  rig.name = whole.name;
  rig.topology = whole.topology;
  for (const RecorderCamera& camera : cameras) {
    const auto found = find_camera(whole, camera.id);
    if (found == whole.cameras.end()) {
      throw Error::bad_input("the rig has no camera \"" + camera.id + "\"", file.string(),
                             "Use the rig's ids in the configuration");
    }
    check_size(found->geometry, camera, file,
               "Set the source to the size that was calibrated, or correct the rig");
    rig.cameras.push_back(*found);
  }
  return rig;
}

RecordingTake resume_take(const std::filesystem::path& folder,
                          const std::vector<RecorderCamera>& cameras, const std::string& node,
                          std::optional<Nanoseconds> start_utc, std::optional<double> duration_s,
                          const std::filesystem::path& other) {
  check_times(schemas::read_take(ContainedPath{folder, "take.json"}), start_utc, duration_s,
              folder / "take.json");
  const schemas::RigDocument rig = schemas::read_rig(ContainedPath{folder, "rig.json"});
  for (const RecorderCamera& camera : cameras) {
    const auto found = find_camera(rig, camera.id);
    if (found == rig.cameras.end()) continue;  // resume() reports this
    check_size(found->geometry, camera, folder / "rig.json",
               "Set the source to the size that the take began with, or record into a new take");
  }
  std::vector<std::string> ids;
  for (const RecorderCamera& camera : cameras) ids.push_back(camera.id);
  return RecordingTake::resume(folder, ids, node, other);
}

schemas::TakeDocument make_take_document(const schemas::RecordConfig& config,
                                         const std::vector<RecorderCamera>& cameras,
                                         const std::string& node, Nanoseconds epoch_utc,
                                         const std::string& created_by) {
  schemas::TakeDocument take;
  take.name = config.name;
  take.created_by = created_by;
  take.epoch_utc = epoch_utc;
  take.color_space = config.color_space;
  take.clock = common(cameras, &SourceDescription::clock, "host");
  take.timestamp_event = common(cameras, &SourceDescription::timestamp_event, "unknown");
  take.nominal_fps = config.nominal_fps;
  std::vector<double> rates;
  for (const RecorderCamera& camera : cameras) {
    const double rate = camera.source->description().fps;
    // What a device states is not trusted. 0: unknown.
    rates.push_back(rate >= kMinRateInFiles && rate <= kMaxRateInFiles ? rate : 0);
    take.cameras.push_back({.id = camera.id, .archive = {}, .journal = {}, .node = node});
  }
  if (take.nominal_fps == 0) {
    const auto middle = rates.begin() + static_cast<std::ptrdiff_t>(rates.size() / 2);
    std::nth_element(rates.begin(), middle, rates.end());
    take.nominal_fps = *middle;
  }
  return take;
}

}  // namespace raystage::ingest
