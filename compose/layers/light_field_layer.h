// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "compose/camera/curves.h"
#include "compose/exr/header.h"
#include "compose/layers/fingerprint.h"
#include "render/renderer.h"
#include "schemas/hole_fill.h"
#include "schemas/shot_document.h"
#include "store/mattes/take_matte.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

/// What to show at a shot frame for which a take has nothing (OpenTimelineIO's policies).
enum class MissingFrames {
  kError,  ///< refuse before anything is rendered
  kHold,   ///< the nearest instant that there is, the earlier first
  kBlack   ///< a frame with alpha and coverage 0
};

/// What a frame of the shot shows of a take.
struct ShownInstant {
  std::optional<int> tick;  ///< index into Timeline::ticks; none: nothing
  bool held = false;        ///< not the instant asked for
};

/// A light field in a shot: its take opened, and everything checked that can be before rendering.
class LightFieldLayer {
 public:
  /// Throws Error (bad input): take, timeline or an archive missing or wrong, unknown method, a
  /// focal plane `best` without a depth range. `index`: of the shot's layers. `shot_file`:
  /// what errors name. `folder`: what paths are relative to. `fill`: in place of what the layer
  /// says. `target`: not empty, the method `auto` with these options in place of the layer's.
  /// `hosts`: as ShotPlanOptions.
  LightFieldLayer(const ShotDocument& shot, std::size_t index,
                  const std::filesystem::path& shot_file, const std::filesystem::path& folder,
                  std::optional<HoleFill> fill, const OptionValues& target, TakeHosts* hosts);
  LightFieldLayer(const LightFieldLayer&) = delete;  // the matte refers to the take
  LightFieldLayer& operator=(const LightFieldLayer&) = delete;

  std::size_t index() const { return index_; }
  const Take& take() const { return take_; }
  const Timeline& timeline() const { return timeline_; }
  /// What shows of the take's frames; null: all.
  const std::shared_ptr<const TakeMatte>& matte() const { return matte_; }
  const Reconstruction& reconstruction() const { return reconstruction_; }
  /// At a frame of the shot. As its camera focuses, where the layer's focal plane is to be the
  /// camera's: there, and `aperture` with its f-number.
  Reconstruction reconstruction_for(const ExrCamera& camera, int frame) const;
  bool focuses_as_camera() const {
    return layer_.focal_plane.kind == ShotDocument::FocalPlane::Kind::kCamera;
  }
  const FrameSelection& tick(const ShownInstant& shown) const {
    return timeline_.ticks[static_cast<std::size_t>(*shown.tick)];
  }

  /// Time in the take that a frame of the shot shows: first tick + start + (frame - first frame) /
  /// fps * speed; nanoseconds since the take's epoch.
  Nanoseconds take_time(int frame) const;
  /// The tick nearest to take_time(); none where that is more than half a tick outside the timeline
  /// or no camera has a frame there. A timeline of one tick is a still: shown at every frame.
  std::optional<int> tick_at(int frame) const;
  ShownInstant shown_at(int frame, MissingFrames policy) const;

  /// "the take ... lasts": of where to look, for an error about frames it has nothing for.
  std::string length_text() const;

  /// Throws Error (bad input) where a file that the method reads for the frame is missing.
  void check_files(int frame, const ShownInstant& shown) const;

  /// What determines the layer's pixels at a frame: method, take.json and rig.json, and time and
  /// XXH3 of each source frame (those of the ticks before and after, too, where the method looks at
  /// them). The timeline counts by what it selects, so that a take synchronised anew to the same
  /// frames needs no new rendering.
  void add_to(Fingerprint& print, int frame, const ShownInstant& shown) const;

  /// What the header of a frame tells of the take and of the method.
  void describe(const ShownInstant& shown, ExrMetadata& metadata) const;

 private:
  std::optional<int> nearest_present(int tick) const;
  std::vector<std::filesystem::path> files_read(const ShownInstant& shown) const;
  std::string common_fingerprint() const;
  void add_sources(const FrameSelection& tick, Fingerprint& print) const;

  std::size_t index_ = 0;
  std::filesystem::path shot_file_;
  ShotDocument::Layer layer_;
  int first_frame_ = 1, fps_numerator_ = 24, fps_denominator_ = 1;
  Take take_;
  Timeline timeline_;
  std::shared_ptr<const TakeMatte> matte_;
  Channel<double> focus_;  ///< metres in front of the array; null: it rests
  Reconstruction reconstruction_;
  std::string common_;  ///< fingerprint of what is the same at every frame
};

/// The plane that a shot's focal plane stands for, for Reconstruction::focal_plane. Throws Error
/// (bad input), with `where` in it, for kBest without a depth range or a degenerate equation.
Eigen::Vector4d focal_plane_equation(const ShotDocument::FocalPlane& plane, const Rig& rig,
                                     const std::optional<DepthRange>& depth_range,
                                     const std::string& where);

}  // namespace raystage
