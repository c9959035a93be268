// SPDX-License-Identifier: Apache-2.0
// For tests of imported depth maps: takes and the true depths of their cameras.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "depths/depth_image.h"
#include "depths/import_depths.h"
#include "images/image_file.h"
#include "render/common/image_quality.h"
#include "testing/render/test_depth.h"

namespace raystage::testing {

/// Returns the distance to the scene of DepthTest::step_edge().
inline double step_distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const Plane& plane = hits_wall(from, direction) ? kFront : kBack;
  return plane.distance(from, direction);
}

inline double slanted_distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  return kSlanted.distance(from, direction);
}

using Distance = double (*)(const Eigen::Vector3d&, const Eigen::Vector3d&);

/// Returns the true planar depths of a camera at a resolution, in its recorded pixels.
inline std::vector<float> true_depths(const rig::Rig::Camera& camera, int width, int height,
                                      Distance distance = step_distance) {
  std::vector<float> z;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto ray = camera.model.unproject(
          {(x + 0.5) * camera.model.width() / width, (y + 0.5) * camera.model.height() / height});
      if (!ray) {
        z.push_back(0);
        continue;
      }
      const Eigen::Vector3d direction = camera.pose.world_from_camera_rotation * *ray;
      z.push_back(static_cast<float>(distance(camera.pose.position, direction) * -ray->z()));
    }
  }
  return z;
}

/// Takes whose true depths are imported as maps.
class ImportDepths : public DepthTest {
 protected:
  std::filesystem::path maps() const { return folder_.path() / "maps"; }
  /// Writes the true depths of all cameras.
  void write_maps(const store::Take& take, bool as_png = false, int divisor = 1) const {
    for (std::size_t i = 0; i < take.rig().cameras.size(); ++i) {
      const rig::Rig::Camera& camera = take.rig().cameras[i];
      const int width = camera.model.width() / divisor, height = camera.model.height() / divisor;
      const std::vector<float> z = true_depths(camera, width, height, distance_);
      const std::filesystem::path folder = maps() / take.document().cameras[i].id;
      create_folder(folder);
      if (!as_png) {
        images::write_depth_image(width, height, z, folder / "000001.exr");
        continue;
      }
      render::InverseDepthMap map(width, height);
      std::ranges::transform(z, map.values.begin(), [](float depth) { return 1 / depth; });
      write_file_atomically(folder / "000001.png", depths::encode_depth_png(map, kRange, "a map"));
    }
  }
  static const schemas::Distortion& barrel() {
    static const schemas::Distortion kBarrel{-0.2, 0.05, 0.001, -0.001, 0};
    return kBarrel;
  }
  store::Take write_step(int rows, int columns, const schemas::Distortion& distortion = {}) {
    settings_ = step_edge(rows, columns);
    settings_.cameras = camera_grid(rows, columns, 0.1, 96, 72, distortion);
    settings_.samples = 3;
    return write(settings_);
  }
  /// Returns the PSNR of a view by a method against the scene, dB.
  double quality(const store::Take& take, const render::ReconstructionOptions& how) const {
    schemas::CameraGeometry geometry = settings_.cameras[0];
    geometry.intrinsics.distortion = {};
    geometry.world_from_camera = settings_.cameras[0].world_from_camera;
    render::VirtualCamera view = render::virtual_camera_from_geometry(geometry);
    view.pose.position = Eigen::Vector3d(0.04, 0.03, 0);
    view.pose.world_from_camera_rotation.setIdentity();
    schemas::CameraGeometry at_view = geometry;
    at_view.world_from_camera = {1, 0, 0, 0.04, 0, 1, 0, 0.03, 0, 0, 1, 0, 0, 0, 0, 1};
    const render::RenderedView image = render_reconstruction(take, view, how, {}, 0);
    return render::compare_images(render::srgb_image(image),
                                  render_camera_image(at_view, settings_),
                                  render::coverage_mask(image))
        .psnr_db;
  }
  std::string refusal(const store::Take& take,
                      const depths::DepthImportOptions& options = {}) const {
    try {
      depths::import_depths(take, maps(), options, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
      return error.what();
    }
    return "accepted";
  }
  static std::size_t stored_maps(const store::Take& take) {
    std::size_t count = 0;
    std::error_code none;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(
             take.folder() / schemas::ImportedDepthsDocument::kFolder, none)) {
      if (entry.path().extension() == ".zst") ++count;
    }
    return count;
  }
  static depths::DepthImportOptions png_options() {
    depths::DepthImportOptions options;
    options.encoding.inverse_range = kRange;
    return options;
  }

  static constexpr schemas::DepthRange kRange{1.5, 9};
  SyntheticTake settings_;
  Distance distance_ = step_distance;  ///< to the scene
};

}  // namespace raystage::testing
