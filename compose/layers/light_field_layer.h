// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "compose/camera/animation_curves.h"
#include "compose/exr/exr_header.h"
#include "compose/layers/layer.h"
#include "render/renderer.h"
#include "schemas/hole_fill.h"
#include "schemas/shot_document.h"
#include "store/processing/mattes/take_matte.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::render {
class Method;
class MethodOptions;
}  // namespace raystage::render

namespace raystage::compose {

/// A light field in a shot: opens the take and checks what can be checked before rendering.
class LightFieldLayer final : public Layer {
 public:
  /// Checks the take of a layer. `index`: of the shot's layers. `shot_file`: named by errors.
  /// `folder`: what paths are relative to. `fill`: replaces that of the layer. `target`: if not
  /// empty, the method `auto` with these options replaces that of the layer. Throws Error (bad
  /// input) if take, timeline or an archive is missing or wrong, the method unknown, or the focal
  /// plane is `best` without a depth range.
  LightFieldLayer(const schemas::ShotDocument& shot, std::size_t index,
                  const std::filesystem::path& shot_file, const std::filesystem::path& folder,
                  store::Take take, std::optional<schemas::HoleFill> fill,
                  const schemas::OptionValues& target, int camera_step = 1);

  std::size_t index() const { return index_; }
  const store::Take& take() const { return take_; }
  const store::Timeline& timeline() const { return timeline_; }
  /// Returns the matte of the take's frames; null: none.
  const std::shared_ptr<const store::TakeMatte>& matte() const { return matte_; }
  const render::ReconstructionOptions& reconstruction() const { return reconstruction_; }
  const render::Method& method() const;
  render::MethodOptions method_options() const;  ///< of `reconstruction`, with defaults
  bool reads_adjacent_frames() const;            ///< see Method
  /// Returns Method::depends_on_shown_views().
  bool depends_on_shown_views() const;
  /// Returns the depth range of the scene: that of the method's options, else the take's.
  std::optional<schemas::DepthRange> depth_range() const;
  /// Returns the settings at a frame. If the focal plane follows the camera, it is at the camera's
  /// focus distance, and methods with a lens get its f-number. If the array looks around, a plane
  /// at a depth is perpendicular to the camera's axis.
  render::ReconstructionOptions reconstruction_for(const ExrCamera& camera, double frame) const;
  /// Returns the settings of a preview by another method: its default options with the layer's
  /// depth range. The focal plane is at the camera's focus distance, or else that of the layer.
  render::ReconstructionOptions preview_reconstruction(std::string_view method,
                                                       const ExrCamera& camera, double frame) const;
  bool focal_plane_follows_camera() const {
    return layer_.focal_plane.kind == schemas::ShotDocument::FocalPlane::Kind::kCamera;
  }
  /// Returns the frames of an instant: ShownTick::tick.
  store::FrameSelection frames_of(int tick) const;
  /// Returns the ticks before and after an instant that methods with adjacent frames read.
  std::vector<int> adjacent_ticks(int tick) const;

  /// Returns the time in the take that a frame shows, seconds since its first tick: that of its
  /// time keys, or start + (frame - first frame) / fps * speed.
  double take_seconds(double frame) const;
  /// Returns the same in nanoseconds since the take's epoch.
  Nanoseconds take_time(double frame) const;
  /// Returns the tick nearest to take_time(); none if that is more than half a tick outside the
  /// timeline, or if no camera has a frame. A timeline of one tick is shown at every frame.
  std::optional<int> tick_at(double frame) const;
  /// Returns what a frame shows. With exact times instants between ticks have numbers beyond those
  /// of the timeline, which depend on the shot only.
  ShownTick shown_tick_at(int frame, MissingFrames policy) const;
  /// Returns what is shown while the shutter is open: with exact times the time `offset` frames
  /// from a frame, a multiple of 1 / kOffsetsPerFrame; `of_frame`, what the frame shows, with
  /// ticks, or if the take has no such time.
  ShownTick shown_tick_in_exposure(int frame, double offset, const ShownTick& of_frame) const;
  /// Returns the time within the shot, frames, of an exact time within an exposure; nullopt: the
  /// tick is another one.
  std::optional<double> time_in_exposure(int tick) const;
  /// Returns whether pictures of times between two fractional frames may differ.
  bool moves_between(double first, double last) const;

  /// Returns "it lasts N s from its first tick", for messages.
  std::string take_duration_text() const;

  const LightFieldLayer* as_light_field() const override { return this; }
  void check_frame(const LayerFrameCheck& check) const override;
  /// Adds method, take.json and rig.json, and time and XXH3 of each source frame (those of the
  /// ticks before and after, too, if the method reads them). Of the timeline only the selected
  /// frames count: a new resynchronisation that selects the same frames needs no new rendering.
  void add_to_fingerprint(Fingerprint& print, double frame, const ShownTick& shown) const override;
  bool fill_metadata(const ShownTick& shown, ExrMetadata& metadata) const override;

  std::size_t shared_bytes() const override { return matte_ ? matte_->bytes() : 0; }
  /// Returns the memory of all frames of an instant, decoded, bytes: the most that a view holds.
  std::size_t decoded_frame_bytes() const;
  LayerStage stage() const override { return LayerStage::kLightFields; }
  bool is_in_scene_space() const override { return true; }
  bool is_transparent_where_unseen() const override;
  std::unique_ptr<const LayerRenderer> make_renderer(
      const LayerRendererOptions& settings) const override;

 private:
  std::optional<int> nearest_present(int tick) const;
  std::optional<int> exact_tick_at(double frame) const;
  int first_frame_of_time(int frame) const;
  std::vector<std::filesystem::path> input_files(const ShownTick& shown) const;
  std::string common_fingerprint() const;
  void add_sources(const store::FrameSelection& tick, Fingerprint& print) const;

  std::size_t index_ = 0;
  std::filesystem::path shot_file_;
  schemas::ShotDocument::Layer layer_;
  int first_frame_ = 1, fps_numerator_ = 24, fps_denominator_ = 1;
  store::Take take_;
  store::Timeline timeline_;
  std::shared_ptr<const store::TakeMatte> matte_;
  AnimationChannel<double> focus_;     ///< metres in front of the array; null: not animated
  std::optional<double> focal_depth_;  ///< of the focal plane from the array, metres; null: none
  AnimationChannel<double> time_;      ///< seconds since the first tick; null: at constant speed
  render::ReconstructionOptions reconstruction_;
  std::string common_;  ///< fingerprint of the inputs that all frames share
};

/// Returns the plane of a shot's focal plane, as ReconstructionOptions::focal_plane. Throws Error
/// (bad input), which names `where`, for kBest without a depth range or a degenerate equation.
Eigen::Vector4d focal_plane_equation(const schemas::ShotDocument::FocalPlane& plane,
                                     const rig::Rig& rig,
                                     const std::optional<schemas::DepthRange>& depth_range,
                                     const std::string& where);

}  // namespace raystage::compose
