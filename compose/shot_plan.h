// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/camera_path.h"
#include "compose/exr_header.h"
#include "compose/fingerprint.h"
#include "render/renderer.h"
#include "schemas/hole_fill.h"
#include "schemas/shot_document.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

/// Changes whenever the same inputs give other pixels, so that `--existing skip` renders them anew.
inline constexpr int kReconstructionVersion = 4;

/// What to show at a shot frame for which the take has nothing (OpenTimelineIO's policies).
enum class MissingFrames {
  kError,  ///< refuse before anything is rendered
  kHold,   ///< the nearest instant that there is, the earlier first
  kBlack   ///< a frame with alpha and coverage 0
};

/// What a frame of the shot shows.
struct PlannedFrame {
  int frame = 0;
  std::optional<int> tick;  ///< index into Timeline::ticks; none: black
  bool held = false;        ///< not the instant asked for
};

/// A shot with its take opened and everything checked that can be before rendering.
class ShotPlan {
 public:
  /// Throws Error (bad input): shot, take, timeline or an archive missing or wrong, unknown method
  /// or compression, a focal plane `best` without a depth range.
  /// `fill`: in place of what the shot says. `target`: not empty, the method `auto` with these
  /// options in place of the layer's.
  explicit ShotPlan(const std::filesystem::path& shot_file, std::optional<HoleFill> fill = {},
                    const OptionValues& target = {});

  const ShotDocument& shot() const { return shot_; }
  const Take& take() const { return take_; }
  const Timeline& timeline() const { return timeline_; }
  const Reconstruction& reconstruction() const { return reconstruction_; }
  VirtualCamera camera(int frame) const { return path_.camera(frame, shot_.width, shot_.height); }

  /// Time in the take that a frame of the shot shows: first tick + start + (frame - first frame) /
  /// fps * speed; nanoseconds since the take's epoch.
  Nanoseconds take_time(int frame) const;
  /// The tick nearest to take_time(); none where that is more than half a tick outside the timeline
  /// or no camera has a frame there. A timeline of one tick is a still: shown at every frame.
  std::optional<int> tick_at(int frame) const;
  /// With kError throws Error (bad input) listing the frames for which there is nothing.
  std::vector<PlannedFrame> plan(std::span<const int> frames, MissingFrames policy) const;

  /// Throws Error (bad input) where a file that the method reads for one of the frames is missing.
  void check_files(std::span<const PlannedFrame> frames) const;

  /// Of everything that determines the file of a frame: the camera at it, layer, size and output of
  /// the shot, take.json and rig.json, time and XXH3 of each source frame (those of the ticks
  /// before and after, too, where the method looks at them), kReconstructionVersion. Not of paths,
  /// threads or other frames. The timeline counts by what it selects, so that a take synchronised
  /// anew to the same frames needs no new rendering.
  std::string fingerprint(const PlannedFrame& frame, bool chromaticities,
                          bool coverage_measures) const;
  ExrMetadata metadata(const PlannedFrame& frame) const;

 private:
  std::optional<int> nearest_present(int tick) const;
  /// That the method reads for the frame, beside the archives.
  std::vector<std::filesystem::path> files_read(const PlannedFrame& frame) const;
  /// Time and XXH3 of the frames of a tick.
  void add_sources(const FrameSelection& tick, Fingerprint& print) const;

  std::filesystem::path shot_file_;
  ShotDocument shot_;
  Take take_;
  Timeline timeline_;
  CameraPath path_;
  Reconstruction reconstruction_;
  Fingerprint common_;
};

/// The plane that a shot's focal plane stands for, for Reconstruction::focal_plane. Throws Error
/// (bad input), with `where` in it, for kBest without a depth range or a degenerate equation.
Eigen::Vector4d focal_plane_equation(const ShotDocument::FocalPlane& plane, const Rig& rig,
                                     const std::optional<DepthRange>& depth_range,
                                     const std::string& where);

}  // namespace raystage
