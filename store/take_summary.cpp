// SPDX-License-Identifier: Apache-2.0
// Summarises a take for `raystage info`: records by status, rate, duration, spacing of the cameras
// and the alias-free distance zmin = spacing * f / (2 dv) (thesis eq. 4.3). Cost: opens every
// archive; spacing needs cameras squared.
#include "store/take_summary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "base/mapped_file.h"
#include "schemas/rig_document.h"
#include "store/jpeg/layout.h"
#include "store/lost_frames.h"
#include "store/matroska.h"
#include "store/recordings.h"
#include "store/temporal/temporal_frame.h"
#include "store/tick_phase.h"

namespace raystage::store {
namespace {

std::optional<bool> restart_markers_of(const ArchiveReader& archive, const std::string& id) {
  if (archive.frames().empty() || archive.is_packed(0)) return std::nullopt;
  try {
    return parse_jpeg_layout(archive.jpeg(0), id).restart_interval > 0;
  } catch (const Error&) {
    return std::nullopt;
  }
}

/// Returns whether an archive states a size that it no longer has.
bool is_cut(const Take& take, int camera) {
  if (take.archive(camera).is_remote()) return false;
  const auto& name = take.document().cameras[static_cast<std::size_t>(camera)].archive;
  const MappedFile file(take.file(name));
  return read_mapped([&] { return matroska::read_preamble(file.bytes(), name).is_cut; }, file);
}

TakeSummary::Camera summary_of(const Take& take, int camera) {
  TakeSummary::Camera result;
  result.id = take.document().cameras[camera].id;
  const auto& model = take.rig().cameras[camera].model;
  result.width = model.width();
  result.height = model.height();
  result.pixels = take.document().cameras[camera].pixels;
  try {
    const ArchiveReader& archive = take.archive(camera);
    result.lost = static_cast<int>(std::ranges::count_if(
        archive.frames(), [&](const FrameRecord& frame) { return is_lost(archive, frame); }));
    result.frames = static_cast<int>(archive.frames().size()) - result.lost;
    for (const FrameRecord& record : archive.records()) {
      ++result.by_status.at(static_cast<std::size_t>(record.status));
      result.unverified += record.is_unverified ? 1 : 0;
    }
    result.recovered = archive.recovered_frames();
    result.damaged_records = archive.damaged_records();
    result.closed = archive.was_closed();
    result.is_cut = result.lost > 0 || (!result.closed && is_cut(take, camera));
    result.bytes = archive.bytes();
    result.packed = archive.description().codec == FrameCodec::kPacked;
    for (int frame = 0; result.packed && frame < result.frames + result.lost; ++frame) {
      result.packed_frames += archive.is_packed(frame) ? 1 : 0;
    }
    if (is_temporal(archive.description().codec)) {
      const FrameCodec codec = archive.description().codec;
      result.video = name_of(video_codec_of(codec));
      if (refers_to_cameras(codec)) result.video += " across cameras";
    } else if (!result.pixels) {
      result.restart_markers = restart_markers_of(archive, result.id);
    }
  } catch (const Error& error) {
    result.error = error.what();
  }
  return result;
}

std::uint64_t size_below(const std::filesystem::path& folder) {
  std::uint64_t bytes = 0;
  std::error_code ignored;
  for (std::filesystem::recursive_directory_iterator entry(folder, ignored), end; entry != end;
       entry.increment(ignored)) {
    if (!entry->is_regular_file(ignored)) continue;
    const auto size = entry->file_size(ignored);
    if (!ignored) bytes += size;
  }
  return bytes;
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void add_times(const Take& take, TakeSummary& summary) {
  std::vector<std::vector<Nanoseconds>> times;
  Nanoseconds first = std::numeric_limits<Nanoseconds>::max(), last = -1;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    if (!summary.cameras[camera].error.empty()) continue;
    std::vector<Nanoseconds> column;
    for (const FrameRecord& frame : take.archive(camera).frames()) column.push_back(frame.time_ns);
    if (column.empty()) continue;
    first = std::min(first, column.front());
    last = std::max(last, column.back());
    times.push_back(std::move(column));
  }
  summary.fps = detect_frame_rate(times);
  if (summary.fps == 0) summary.fps = take.document().nominal_fps;
  if (last < 0) return;
  summary.first = first;
  summary.duration = last - first;
  if (summary.fps > 0) {
    summary.duration += std::llround(static_cast<double>(kNanosecondsPerSecond) / summary.fps);
  }
}

void add_restarts(const Take& take, TakeSummary& summary) {
  try {
    std::set<Nanoseconds> all;
    for (const auto& of_camera : recorder_restarts(take)) {
      all.insert(of_camera.begin(), of_camera.end());
    }
    summary.restarts.assign(all.begin(), all.end());
    for (const schemas::RecordingDocument& recording : read_recordings(take.folder())) {
      for (const schemas::RecordingDocument::Session& session : recording.sessions) {
        if (session.late() > 0) summary.late_nodes.emplace_back(recording.node, session.late());
      }
    }
  } catch (const Error& error) {
    summary.restarts_error = error.what();
  }
}

}  // namespace

std::uint64_t TakeSummary::frames() const {
  std::uint64_t sum = 0;
  for (const Camera& camera : cameras) sum += static_cast<std::uint64_t>(camera.frames);
  return sum;
}

bool TakeSummary::is_readable() const {
  return std::ranges::all_of(cameras, [](const Camera& camera) { return camera.error.empty(); });
}

double median_baseline(const rig::Rig& rig) {
  std::vector<double> nearest;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    double distance = std::numeric_limits<double>::infinity();
    for (const rig::Rig::Camera& other : rig.cameras) {
      if (&other == &camera) continue;
      distance = std::min(distance, (other.pose.position - camera.pose.position).norm());
    }
    if (std::isfinite(distance)) nearest.push_back(distance);
  }
  return median_of(std::move(nearest));
}

double min_alias_free_distance(double spacing_m, double focal_length_px) {
  return spacing_m * focal_length_px / 2;
}

TakeSummary summarise_take(const Take& take) {
  TakeSummary summary;
  std::vector<double> focal_lengths;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    summary.cameras.push_back(summary_of(take, camera));
    summary.archive_bytes += summary.cameras.back().bytes;
    focal_lengths.push_back(take.rig().cameras[camera].model.intrinsics().fx);
  }
  summary.bytes_on_disk = size_below(take.folder());
  add_times(take, summary);
  add_restarts(take, summary);
  summary.calibrated = schemas::is_calibrated(schemas::read_rig(take.file("rig.json")));
  summary.shutters = summarise_shutters(take.rig());
  summary.spacing = median_baseline(take.rig());
  summary.lenses = rig::summarise_lenses(take.rig());
  summary.min_alias_free_distance =
      min_alias_free_distance(summary.spacing, median_of(std::move(focal_lengths)));
  if (!summary.is_readable()) {
    summary.timeline_error = "not checked, because an archive cannot be read";
    return summary;
  }
  try {
    const Timeline timeline = read_timeline(take);
    summary.timeline = {timeline.fps, static_cast<int>(timeline.ticks.size()),
                        timeline_statistics(timeline)};
  } catch (const Error& error) {
    summary.timeline_error = error.what_happened() + ". " + error.what_to_do();
  }
  return summary;
}

}  // namespace raystage::store
