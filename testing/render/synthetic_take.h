// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "render/common/view.h"
#include "schemas/geometry.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/rgb_image.h"
#include "testing/test_folder.h"

namespace raystage::testing {

/// Linear RGB of a painted plane z = -depth at (x, y) in the world, metres; smooth.
std::array<double, 3> painted_plane(double x, double y);

/// Linear RGB of what a ray sees (origin and direction in the world, metres; direction not unit).
using SceneFunction =
    std::function<std::array<double, 3>(const Eigen::Vector3d&, const Eigen::Vector3d&)>;

struct SyntheticTake {
  std::vector<CameraGeometry> cameras;
  /// Where the take puts the origin of all that stands here, in its world.
  std::array<double, 3> origin{};
  double plane_depth = 4;                   ///< the painted plane is z = -plane_depth
  SceneFunction scene;                      ///< what there is to see instead, if given
  int samples = 1;                          ///< of a pixel along each axis, averaged
  bool has_depth_range = true;              ///< whether take.json says one
  std::optional<DepthRange> depth_range;    ///< as take.json says it; unless given, the plane's
  int frames = 1;                           ///< at 15 fps
  std::vector<std::pair<int, int>> absent;  ///< (camera, frame) that were dropped
  PhotometricResponse photometric;          ///< of every camera, as calibrated
  JpegEncodeSettings jpeg;
};

/// `rows` x `columns` wall-eyed cameras in the plane z = 0 around the origin, 62 degrees wide.
std::vector<CameraGeometry> camera_grid(int rows, int columns, double spacing, int width,
                                        int height, const Distortion& distortion = {});

/// What a camera shows of the settings' scene.
RgbImage render_camera_image(const CameraGeometry& camera, const SyntheticTake& settings);

/// Writes the take to `folder` (which must not exist).
void write_synthetic_take(const SyntheticTake& settings, const std::filesystem::path& folder);

}  // namespace raystage::testing
