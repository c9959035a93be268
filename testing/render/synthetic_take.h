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

/// Returns the smooth linear RGB of a painted plane z = -depth at world position (x, y), metres.
std::array<double, 3> painted_plane(double x, double y);

/// Returns the linear RGB that a ray sees. The ray has an origin and a direction of any length in
/// the world, in metres.
using SceneFunction =
    std::function<std::array<double, 3>(const Eigen::Vector3d&, const Eigen::Vector3d&)>;

struct SyntheticTake {
  std::vector<schemas::CameraGeometry> cameras;
  std::array<double, 3> origin{};  ///< position of this description's origin in the take's world
  double plane_depth = 4;          ///< the painted plane is z = -plane_depth
  SceneFunction scene;             ///< replaces the painted plane, if given
  int samples = 1;                 ///< per pixel and axis, averaged
  bool has_depth_range = true;     ///< whether take.json has one
  std::optional<schemas::DepthRange> depth_range;  ///< of take.json; by default that of the plane
  int frames = 1;                                  ///< at 15 fps
  std::vector<std::pair<int, int>> absent;         ///< dropped frames: (camera, frame)
  schemas::PhotometricResponse photometric;        ///< calibration of every camera
  store::JpegEncodeOptions jpeg;
};

/// Returns `rows` x `columns` wall-eyed cameras in the plane z = 0 at the origin, 62 degrees wide.
std::vector<schemas::CameraGeometry> camera_grid(int rows, int columns, double spacing, int width,
                                                 int height,
                                                 const schemas::Distortion& distortion = {});

store::RgbImage render_camera_image(const schemas::CameraGeometry& camera,
                                    const SyntheticTake& options);

/// Writes the take to `folder` (which must not exist).
void write_synthetic_take(const SyntheticTake& options, const std::filesystem::path& folder);

}  // namespace raystage::testing
