// SPDX-License-Identifier: Apache-2.0
// Pictures that hold the views of several eyes.
#pragma once

#include <functional>
#include <vector>

#include "compose/camera/shot_camera.h"
#include "replay/picture_layout.h"
#include "schemas/viewer_message.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::replay {

/// The camera of one of several views.
struct EyeView {
  compose::CameraState state;
  compose::Eye eye = compose::Eye::kBoth;  ///< of the shot's stereo camera
};

/// What the views of an arrangement are made of.
struct ArrangementOptions {
  schemas::ViewerMessage::Arrangement arrangement;
  PictureSize size;      ///< of the whole picture
  double array_width_m;  ///< views of a quilt spread over this width
};

/// The views of an arrangement in a picture.
struct ArrangedViews {
  std::vector<EyeView> views;
  PictureSize view_size;  ///< of each view
};

/// Columns and rows of a quilt.
inline constexpr int kQuiltColumns = 8, kQuiltRows = 6;

/// Returns the views of an arrangement about a camera. Stereo: as the shot says, or else 65 mm
/// apart with the focal plane at the depth of the screen. A quilt: views side by side, from the
/// left, whose screen is the focal plane.
ArrangedViews arrange_views(const compose::ShotCamera& camera, const compose::CameraState& state,
                            compose::Eye eye, const ArrangementOptions& options);

/// Returns the picture of an arrangement from those of its views, in their order.
store::RgbImage assemble_picture(const ArrangementOptions& options,
                                 const std::vector<store::RgbImage>& views);

}  // namespace raystage::replay
