// SPDX-License-Identifier: Apache-2.0
// Views of scenes in which one depth does not explain what the cameras see: two layers of light
// that add up, as behind glass, and a curtain with fine holes. Method depth must be as good there
// as plane_sweep, which finds a depth for each view among its nearest cameras.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/transfer_function.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_depth.h"

namespace raystage::render {
namespace {

constexpr double kBehind = 4;  // metres, the plane behind

struct SeeThroughScene {
  const char* name;
  double layer_depth;  ///< metres
  double reflected;    ///< share of the light that is the layer's; 0: the layer is a curtain
  double least_psnr;   ///< of method depth, dB
};

/// Returns the light of a textured plane. Textures are equally fine in the cameras' pictures.
std::array<double, 3> light_of_plane(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                                     double depth, double shift) {
  const Eigen::Vector3d hit = eye - ray * ((depth + eye.z()) / ray.z());
  const double scale = 7 / depth;
  return testing::texture(scale * hit.x() + shift, scale * hit.y() - shift);
}

/// Returns how much of the light behind the curtain it hides.
double opacity_of_curtain(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double depth) {
  const Eigen::Vector3d hit = eye - ray * ((depth + eye.z()) / ray.z());
  const double holes = std::sin(43 * hit.x() + 2 * std::sin(5 * hit.y())) *
                       std::sin(37 * hit.y() + 2 * std::sin(6 * hit.x()));
  return std::clamp(0.5 + 3 * holes, 0.0, 1.0);
}

testing::SyntheticTake see_through_take(const SeeThroughScene& scene, int side, int width,
                                        int height) {
  testing::SyntheticTake settings;
  settings.cameras = testing::camera_grid(side, side, 0.06, width, height);
  settings.depth_range = schemas::DepthRange{2, 12};
  settings.samples = 2;
  settings.jpeg.quality = 95;
  settings.scene = [scene](const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
    const auto behind = light_of_plane(eye, ray, kBehind, 0);
    const auto layer = light_of_plane(eye, ray, scene.layer_depth, 0.7);
    const double share =
        scene.reflected > 0 ? scene.reflected : opacity_of_curtain(eye, ray, scene.layer_depth);
    std::array<double, 3> light{};
    for (std::size_t c = 0; c < 3; ++c) light[c] = (1 - share) * behind[c] + share * layer[c];
    return light;
  };
  return settings;
}

/// Returns the PSNR of views between the cameras, dB.
double see_through_psnr(const store::Take& take, const testing::SyntheticTake& settings,
                        const std::string& method) {
  constexpr int kBorder = 8;
  double squares = 0, count = 0;
  const LightFieldRenderer renderer(take, {});
  for (const Eigen::Vector3d& position :
       {Eigen::Vector3d(0.03, 0.03, 0), Eigen::Vector3d(-0.09, 0.04, 0),
        Eigen::Vector3d(0.015, -0.085, 0)}) {
    schemas::CameraGeometry camera = settings.cameras.front();
    for (int axis = 0; axis < 3; ++axis) {
      camera.world_from_camera[static_cast<std::size_t>(4 * axis + 3)] = position[axis];
    }
    const store::RgbImage expected = render_camera_image(camera, settings);
    VirtualCamera view =
        virtual_camera_with_fov(camera.width, camera.height, 1, testing::make_pose(position, 0));
    view.intrinsics = camera.intrinsics;
    const RenderedView image =
        renderer.render(view, store::select_frames(take, 0, 1), {method, {0, 0, 0, 1}, {}});
    for (int y = kBorder; y < camera.height - kBorder; ++y) {
      for (int x = kBorder; x < camera.width - kBorder; ++x) {
        const auto at = static_cast<std::size_t>(y * camera.width + x);
        for (std::size_t c = 0; c < 3; ++c) {
          const double code = 255 * srgb_from_linear(double{image.rgba[4 * at + c]});
          squares += std::pow(std::round(code) - expected.values[3 * at + c], 2);
          ++count;
        }
      }
    }
  }
  return 10 * std::log10(255 * 255 * count / squares);
}

class SeeThrough : public ::testing::TestWithParam<SeeThroughScene> {};

TEST_P(SeeThrough, DepthIsNoWorseThanPlaneSweep) {
  const testing::SyntheticTake settings = see_through_take(GetParam(), 7, 240, 180);
  const testing::TestFolder folder;
  write_synthetic_take(settings, folder.path() / "take");
  const store::Take take(folder.path() / "take");
  const double sweep = see_through_psnr(take, settings, "plane_sweep");
  const double depth = see_through_psnr(take, settings, "depth");
  RecordProperty("plane_sweep_db", std::to_string(sweep));
  RecordProperty("depth_db", std::to_string(depth));
  EXPECT_GE(depth, sweep - 0.02);
  EXPECT_GE(depth, GetParam().least_psnr) << "plane_sweep: " << sweep;
}

std::string name_of_scene(const ::testing::TestParamInfo<SeeThroughScene>& info) {
  return info.param.name;
}

INSTANTIATE_TEST_SUITE_P(
    Layers, SeeThrough,
    ::testing::Values(SeeThroughScene{"NearReflectionOf20Percent", 2.5, 0.2, 41.5},
                      SeeThroughScene{"NearReflectionOf50Percent", 2.5, 0.5, 42},
                      SeeThroughScene{"FarReflectionOf20Percent", 9, 0.2, 42.2},
                      SeeThroughScene{"FarReflectionOf50Percent", 9, 0.5, 42.7},
                      SeeThroughScene{"Curtain", 2.5, 0, 35.4}),
    name_of_scene);

TEST(SeeThroughViews, AreThoseOfTheReferenceForAnyNumberOfThreads) {
  const testing::TestFolder folder;
  write_synthetic_take(see_through_take({"", 2.5, 0.5, 0}, 5, 96, 72), folder.path() / "take");
  const store::Take take(folder.path() / "take");
  // Views in the array, behind it and in front of it.
  for (const double z : {0.0, 0.2, -0.15}) {
    SCOPED_TRACE(z);
    const VirtualCamera view = virtual_camera_with_fov(90, 64, 40 * testing::kDegree,
                                                       testing::make_pose({0.02, 0.013, z}, 2));
    const auto rendered = [&](bool reference, const schemas::OptionValues& options) {
      RendererOptions settings;
      settings.reference = reference;
      return LightFieldRenderer(take, settings)
          .render(view, store::select_frames(take, 0, 1), {"depth", {0, 0, 0, 1}, options});
    };
    const RenderedView image = rendered(false, {});
    testing::expect_equal(image, rendered(true, {}));
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(rendered(false, {}).rgba, image.rgba);
  }
}

}  // namespace
}  // namespace raystage::render
