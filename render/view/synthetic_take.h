// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "render/view/view.h"
#include "schemas/geometry.h"
#include "schemas/rig_document.h"
#include "schemas/test_folder.h"
#include "store/jpeg/encode.h"

namespace raystage::testing {

/// Linear RGB of a painted plane z = -depth at (x, y) in the world, metres; smooth.
std::array<double, 3> painted_plane(double x, double y);

struct SyntheticTake {
  std::vector<CameraGeometry> cameras;
  double plane_depth = 4;  ///< the painted plane is z = -plane_depth
  /// Linear RGB that a ray sees (origin and direction in the world, metres; direction not unit);
  /// where empty, the painted plane.
  std::function<std::array<double, 3>(const Eigen::Vector3d&, const Eigen::Vector3d&)> scene;
  bool knows_depth_range = true;  ///< whether take.json says one
  /// As the take says; unless given the painted plane's. near = 0: the take does not say.
  std::optional<DepthRange> depth_range;
  int frames = 1;                           ///< at 15 fps
  std::vector<std::pair<int, int>> absent;  ///< (camera, frame) that were dropped
  PhotometricResponse photometric;          ///< of every camera, as calibrated
  JpegEncodeSettings jpeg;
};

/// `rows` x `columns` wall-eyed cameras in the plane z = 0 around the origin, 62 degrees wide.
std::vector<CameraGeometry> camera_grid(int rows, int columns, double spacing, int width,
                                        int height, const Distortion& distortion = {});

/// Writes the take to `folder` (which must not exist).
void write_synthetic_take(const SyntheticTake& settings, const std::filesystem::path& folder);

}  // namespace raystage::testing
