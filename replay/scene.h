// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "compose/camera/shot_camera.h"
#include "compose/frame_compositor.h"
#include "compose/sequence_memory_plan.h"
#include "compose/shot_plan.h"
#include "replay/ranges_of_motion.h"
#include "schemas/shot_document.h"

namespace raystage::replay {

struct SceneOptions {
  std::filesystem::path cache_folder;  ///< for derived data; empty: each take's folder
  std::size_t memory_bytes = 0;        ///< 0: half of available_memory()
};

/// A view of a scene.
struct SceneView {
  int frame = 0;  ///< of the shot
  compose::ExrCamera camera;
  compose::PreviewOptions preview = {};
};

/// The layers of an opened shot, with their caches. The camera of the shot is not used: views bring
/// their own. Thread-safe.
class Scene {
 public:
  /// Opens the layers. `shot_file`: where the shot is or would be; its folder is what paths are
  /// relative to. Throws Error (bad input) as ShotPlan.
  Scene(const schemas::ShotDocument& shot, const std::filesystem::path& shot_file,
        const SceneOptions& options);

  const compose::ShotPlan& plan() const { return plan_; }
  const RangesOfMotion& ranges_of_motion() const { return ranges_of_motion_; }
  /// Renders a view. At frames without an instant the takes show the nearest one. Throws Cancelled
  /// once `stop` is requested, and Error as FrameCompositor.
  compose::CompositedView render(const SceneView& view, const std::stop_token& stop) const;
  /// Requests the source frames of the frames after one from the disk, for playing.
  void read_ahead_of(int frame) const;
  /// Returns the instants that a frame shows.
  compose::PlannedFrame planned(int frame) const;

  /// Returns the method for views that must be fast: empty if the methods of all visible light
  /// fields are fast enough.
  std::string fast_method() const;
  /// Returns whether a view at a frame first estimates the depths of an instant, which takes
  /// seconds: they are not stored yet.
  bool must_estimate_depths(int frame) const;
  /// Returns a function that returns the share of the estimation of depths that is done since this
  /// call, [0, 1]; nullopt before it begins. The scene must outlive it.
  std::function<std::optional<double>()> depth_progress() const;

 private:
  compose::ShotPlan plan_;
  compose::SequenceMemoryPlan memory_;
  compose::FrameCompositor compositor_;
  RangesOfMotion ranges_of_motion_;
};

/// Returns the camera of a view of this size for a camera state of a shot. Pixels are square: the
/// height shows less or more of the scene, centred.
compose::ExrCamera make_view_camera(const compose::ShotCamera& shot_camera,
                                    const compose::CameraState& state, compose::Eye eye, int width,
                                    int height);

}  // namespace raystage::replay
