// SPDX-License-Identifier: Apache-2.0
// Where the views of a quilt come from.
#pragma once

#include <memory>
#include <stop_token>

#include "compose/camera/shot_camera.h"
#include "exports/export_quilt.h"
#include "store/jpeg/rgb_image.h"
#include "store/take.h"

namespace raystage::exports {

/// The shape of a quilt's views.
struct QuiltViewShape {
  int width = 0, height = 0;  ///< pixels
  double zoom = 1;            ///< of the shot's focal length
};

/// Makes the views of one frame after another.
class QuiltViews {
 public:
  virtual ~QuiltViews() = default;
  /// Begins a frame of the shot; frames come in increasing order. Sets the distances in the report.
  virtual void begin(int frame, QuiltReport& report) = 0;
  /// Returns view `index` of the frame, from the left: sRGB codes. Throws Cancelled.
  virtual store::RgbImage view(int index, const std::stop_token& stop, QuiltReport& report) = 0;
  /// Counts in the report what the frame lacked.
  virtual void end(QuiltReport& report) = 0;
};

/// Returns the state of a camera `offset` metres to the right, with the same picture of a plane.
compose::CameraState moved_state(const compose::CameraState& state, double offset, double screen_m);

/// Returns the cameras of a row of the rig's grid, from the left as the array sees it. Throws Error
/// (bad input) if there are none.
std::vector<int> cameras_of_row(const store::Take& take, int row);

/// Returns views that are the frames of a row of the array's own cameras, each resampled to a
/// pinhole at its place that looks as the shot's camera does. `frames`: of the shot, those of the
/// take. Refers to the arguments.
std::unique_ptr<QuiltViews> recorded_views(const store::Take& take,
                                           const compose::ShotCamera& camera,
                                           const QuiltExportOptions& options,
                                           const std::vector<int>& frames, QuiltViewShape shape);

}  // namespace raystage::exports
