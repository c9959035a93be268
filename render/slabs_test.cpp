// SPDX-License-Identifier: Apache-2.0
#include "render/slabs/slabs.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Core>
#include <cmath>

#include "base/error.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_slabs.h"

namespace raystage::render::slabs_test {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;
using testing::FastAndReference;
using testing::kDegree;
using testing::kPaintedPlane;
using testing::make_pose;
using testing::mean_alpha;
using testing::render_both;
using testing::SyntheticTake;

VirtualCamera view_from(const Vector3d& position, double yaw, double fov, int width = 120,
                        int height = 90) {
  return virtual_camera_with_fov(width, height, fov * kDegree, make_pose(position, yaw));
}

/// Returns the largest difference from the painted plane, over the pixels that all cameras see.
double error_against_truth(const RenderedView& image, const VirtualCamera& view) {
  double worst = 0;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y * view.width + x);
      if (image.rgba[at * 4 + 3] < 0.999F) continue;
      const auto ray = rig::CameraModel({"v", view.width, view.height, view.intrinsics, {}, {}, {}})
                           .unproject({x + 0.5, y + 0.5});
      const Vector3d direction = view.pose.world_from_camera_rotation * *ray;
      const double t = (-4 - view.pose.position.z()) / direction.z();
      const Vector3d hit = view.pose.position + t * direction;
      const auto truth = testing::painted_plane(hit.x(), hit.y());
      for (std::size_t c = 0; c < 3; ++c) {
        worst = std::max(worst, std::abs(truth[c] - static_cast<double>(image.rgba[at * 4 + c])));
      }
    }
  }
  return worst;
}

SyntheticTake grid_take(int rows, int columns, const schemas::Distortion& distortion = {}) {
  SyntheticTake take;
  take.cameras = testing::camera_grid(rows, columns, 0.06, 160, 120, distortion);
  return take;
}

void turn(schemas::CameraGeometry& camera, double yaw_degrees, double pitch_degrees = 0) {
  rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
  pose.world_from_camera_rotation =
      make_pose({0, 0, 0}, yaw_degrees, pitch_degrees).world_from_camera_rotation;
  camera.world_from_camera = rig::matrix_from_pose(pose);
}

class Slabs : public ::testing::Test {
 protected:
  store::Take write(const SyntheticTake& settings, const std::string& name = "take") {
    write_synthetic_take(settings, folder_.path() / name);
    return store::Take(folder_.path() / name);
  }
  testing::TestFolder folder_;
};

TEST_F(Slabs, AWallEyedArrayIsExactFromEverywhere) {
  const store::Take take = write(grid_take(4, 5));
  for (const auto& view : {view_from({0.01, 0.02, 0}, 0, 50),      // on the camera plane
                           view_from({0.06, 0.03, 0}, 0, 62),      // at a camera
                           view_from({0.06, 0.03, 1e-12}, 0, 62),  // almost at a camera
                           view_from({0, 0, 0.25}, 3, 40),         // behind it
                           view_from({0.02, 0, -0.3}, -4, 30),     // in front of it
                           view_from({0.25, 0, 0.5}, 20, 60),      // from the side
                           view_from({0, 0, 40}, 0, 0.5),          // from far behind
                           view_from({0, 0, 1e6}, 0, 2e-5)}) {
    SCOPED_TRACE(view.pose.position.transpose());
    const FastAndReference pair = render_both(take, view);
    expect_equal(pair);
    EXPECT_GT(mean_alpha(pair.fast), 0.05);
    EXPECT_LT(error_against_truth(pair.fast, view), 0.035);  // JPEG's quantisation
  }
}

TEST_F(Slabs, AnyFocalPlaneEntersWhenRaysAreLookedUp) {
  const store::Take take = write(grid_take(3, 3));
  const VirtualCamera view = view_from({0.01, 0.01, 0.05}, 2, 45);
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const std::vector<Vector4d> planes{{0, 0, 0, 1},    {0, 0, 1, 1e9},   {0, 0, 1, 0.8},
                                     {0, 0, 1, 1e-3}, {0.4, 0.2, 1, 3}, {0, 1, 0, 0.5},
                                     {0, 0, 1, -0.05}};  // the last through the eye
  const LightFieldRenderer renderer(take, {});
  const auto decoded = [&] {
    std::int64_t pixels = 0;
    for (const Vector4d& plane : planes) {
      pixels += renderer.render(view, frames, {"slabs", plane}).statistics.pixels_decoded;
    }
    return pixels;
  };
  for (const Vector4d& plane : planes) {
    SCOPED_TRACE(plane.transpose());
    expect_equal(render_both(take, view, {.plane = plane}));
  }
  // The slab of a regular array is used for all planes: each image is made in part, then as a
  // whole.
  EXPECT_LE(decoded(), 2 * 9 * 160 * 120);
  EXPECT_EQ(decoded(), 0);
}

TEST_F(Slabs, DistortedAndToedInCamerasAreRectified) {
  SyntheticTake distorted = grid_take(3, 4, {-0.2, 0.05, 0.001, -0.002, 0.003});
  SyntheticTake toed_in = distorted;
  for (schemas::CameraGeometry& camera : toed_in.cameras) {
    turn(camera, (*camera.column - 1.5) * 6, (*camera.row - 1) * 4);
  }
  int number = 0;
  for (const SyntheticTake& settings : {distorted, toed_in}) {
    const store::Take take = write(settings, std::to_string(number++));
    for (const auto& view : {view_from({0.01, 0.02, 0.02}, 2, 40), view_from({0, 0, 0.3}, 0, 30)}) {
      const FastAndReference pair = render_both(take, view);
      // The rectified image is interpolated once more, and its border is at another position.
      expect_equal(pair, 0.03, 1);
      EXPECT_NEAR(mean_alpha(pair.fast), mean_alpha(pair.reference), 0.005);
      EXPECT_GT(mean_alpha(pair.fast), 0.3);
      EXPECT_LT(error_against_truth(pair.fast, view), 0.03);
      // The difference is smaller if it is sampled more finely.
      const FastAndReference fine = render_both(take, view, {.options = {{"uv_scale", 3.0}}});
      double coarse_error = 0, fine_error = 0;
      for (std::size_t i = 0; i < pair.fast.rgba.size(); ++i) {
        if (pair.reference.rgba[i | 3] < 0.999F || pair.fast.rgba[i | 3] < 0.999F) continue;
        coarse_error += std::abs(pair.fast.rgba[i] - pair.reference.rgba[i]);
        fine_error += std::abs(fine.fast.rgba[i] - fine.reference.rgba[i]);
      }
      EXPECT_LT(fine_error, 0.5 * coarse_error);
    }
  }
}

TEST_F(Slabs, CamerasThatStandAnywhereAreResampled) {
  SyntheticTake settings = grid_take(4, 4);
  int i = 0;
  for (schemas::CameraGeometry& camera : settings.cameras) {
    camera.row.reset();
    camera.column.reset();
    camera.world_from_camera[3] += 0.013 * std::sin(5.0 * i);
    camera.world_from_camera[7] += 0.011 * std::cos(3.0 * i);
    camera.world_from_camera[11] += 0.006 * std::cos(7.0 * i++);
  }
  const store::Take take = write(settings);
  const VirtualCamera view = view_from({0.01, 0.02, 0.1}, 2, 30);
  const FastAndReference pair = render_both(take, view);
  expect_equal(pair, 0.01, 1);
  EXPECT_NEAR(mean_alpha(pair.fast), mean_alpha(pair.reference), 0.005);
  EXPECT_GT(mean_alpha(pair.fast), 0.9);
  EXPECT_LT(error_against_truth(pair.fast, view), 0.03);
  const FastAndReference asked =
      render_both(take, view, {.options = {{"columns", 7.0}, {"rows", 2.0}}});
  expect_equal(asked, 0.01, 1);
  EXPECT_NE(asked.fast.rgba, pair.fast.rgba);
}

TEST_F(Slabs, InterpolationMayBeCoarser) {
  const store::Take take = write(grid_take(3, 3));
  const VirtualCamera view = view_from({0.013, 0.017, 0.1}, 2, 30);
  std::vector<RenderedView> images;
  for (const char* interpolation : {"quadrilinear", "bilinear_st", "nearest"}) {
    const FastAndReference pair =
        render_both(take, view, {.options = {{"interpolation", interpolation}}});
    std::size_t differ = 0;
    for (std::size_t i = 0; i < pair.fast.rgba.size(); ++i) {
      differ += std::abs(pair.fast.rgba[i] - pair.reference.rgba[i]) > 1e-3F ? 1 : 0;
    }
    EXPECT_LT(differ, pair.fast.rgba.size() / 100);  // float and double round at other pixels
    images.push_back(pair.fast);
  }
  EXPECT_LT(error_against_truth(images[0], view), error_against_truth(images[1], view));
  EXPECT_NE(images[1].rgba, images[2].rgba);
}

TEST_F(Slabs, AnAbsentCamerasNeighboursStandInAndCoverageSaysSo) {
  SyntheticTake settings = grid_take(3, 3);
  settings.frames = 2;
  settings.absent = {{4, 1}};  // the middle camera, second frame
  const store::Take take = write(settings);
  const VirtualCamera view = view_from({0, 0, 0.2}, 0, 20, 90, 90);
  const FastAndReference whole = render_both(take, view);
  const FastAndReference lacking = render_both(take, view, {.frame = 1});
  expect_equal(whole);
  expect_equal(lacking, 5e-3, 2e-3);
  const std::size_t middle = 45 * 90 + 45;
  EXPECT_NEAR(whole.fast.coverage[middle], 1, 1e-5);
  EXPECT_NEAR(lacking.fast.rgba[middle * 4 + 3], 1, 1e-4);
  EXPECT_LT(lacking.fast.coverage[middle], 0.1);
  EXPECT_LT(error_against_truth(lacking.fast, view), 0.03);
}

TEST_F(Slabs, LinesAndSingleCamerasRender) {
  for (const auto& [rows, columns] : {std::pair{1, 4}, {4, 1}, {1, 1}, {1, 2}}) {
    const std::string name = std::to_string(rows) + "x" + std::to_string(columns);
    SCOPED_TRACE(name);
    const store::Take take = write(grid_take(rows, columns), name);
    const VirtualCamera view = view_from({0.005, 0.002, 0.01}, 0, 40, 80, 60);
    const FastAndReference pair = render_both(take, view);
    expect_equal(pair);
    EXPECT_GT(mean_alpha(pair.fast), 0.2);
    EXPECT_LT(error_against_truth(pair.fast, view), 0.03);
  }
}

TEST_F(Slabs, MissingRaysAreMissing) {
  const store::Take take = write(grid_take(3, 3));
  for (const auto& [view, plane] :
       {std::pair{view_from({5, 0, 0.1}, 0, 50), kPaintedPlane},      // past the array's edge
        {view_from({0, 0, 0.1}, 0, 50), Vector4d(0, 0, 1, -2)},       // the plane behind the view
        {view_from({0, 0, 0}, 90, 0.01, 3, 3), kPaintedPlane},        // along the camera plane
        {view_from({0, 0, 1}, 90, 20), Vector4d(1, 0, 0, 3)},         // parallel to it, at its side
        {view_from({0, 0, -8}, 180, 50), kPaintedPlane},              // from behind the scene
        {view_from({0, 0, 0.1}, 0, 50), Vector4d(0, 0, 1, -0.1)}}) {  // the plane through the eye
    SCOPED_TRACE(view.pose.position.transpose());
    const FastAndReference pair = render_both(take, view, {.plane = plane});
    expect_equal(pair);
    for (const float value : pair.fast.rgba) ASSERT_TRUE(std::isfinite(value));
    if (view.pose.position.z() != -8) {
      EXPECT_EQ(mean_alpha(pair.fast), 0);
    }
  }
}

TEST_F(Slabs, BothBlendSpacesAgreeWithTheReference) {
  SyntheticTake settings = grid_take(3, 3);
  settings.photometric.contrast = {1.6, 0.9, 1.2};
  const store::Take take = write(settings);
  const VirtualCamera view = view_from({0.01, 0.02, 0.2}, 1, 30);
  const Vector4d ghosting(0, 0, 1, 1);
  const FastAndReference perceptual = render_both(take, view, {.plane = ghosting});
  const FastAndReference linear =
      render_both(take, view, {.plane = ghosting, .space = store::BlendSpace::kLinear});
  expect_equal(perceptual);
  expect_equal(linear);
  EXPECT_NE(perceptual.fast.rgba, linear.fast.rgba);
}

TEST_F(Slabs, SameBytesForAnyNumberOfThreadsAndAnyMemory) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0, 0, 0, 0}));
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const VirtualCamera view = view_from({0, 0.01, 0.1}, 2, 46, 160, 120);
  const auto render = [&](const RendererOptions& settings) {
    return LightFieldRenderer(take, settings).render(view, frames, {"slabs", kPaintedPlane});
  };
  const RenderedView image = render({});
  for (const std::size_t threads : {1, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    EXPECT_EQ(render({}).rgba, image.rgba);
  }
  // Images of nodes that another view left partial are completed.
  const LightFieldRenderer used(take, {});
  used.render(view_from({0, 0, 0.1}, 0, 15, 40, 30), frames, {"slabs", kPaintedPlane});
  EXPECT_EQ(used.render(view, frames, {"slabs", kPaintedPlane}).rgba, image.rgba);
  RendererOptions little;
  little.result_cache_bytes = 1;
  little.cache_bytes = 1;
  const std::size_t node = 8 * 200 * 160;
  little.working_bytes = 9 * node;  // not all sixteen at once
  const RenderedView in_bands = render(little);
  EXPECT_GT(in_bands.statistics.working_bytes, 4 * node);
  EXPECT_LE(in_bands.statistics.working_bytes, little.working_bytes);
  EXPECT_GT(image.statistics.working_bytes, little.working_bytes);
  EXPECT_EQ(in_bands.rgba, image.rgba);
  EXPECT_EQ(in_bands.coverage, image.coverage);
  little.working_bytes = node;
  EXPECT_THROW(render(little), Error);
}

TEST_F(Slabs, CountsThePixelsThatTheViewDependsOn) {
  const store::Take take = write(grid_take(3, 3, {-0.1, 0.02, 0.001, -0.002, 0}));
  const VirtualCamera view = view_from({0.013, 0.017, 0.1}, 2, 15, 48, 32);
  const auto counted = [&](const schemas::OptionValues& options, bool reference) {
    RendererOptions settings;
    settings.count_needed_pixels = true;
    settings.reference = reference;
    return LightFieldRenderer(take, settings)
        .render(view, store::select_frames(take, 0, 1), {"slabs", kPaintedPlane, options})
        .statistics;
  };
  const RenderStatistics fast = counted({}, false), slow = counted({}, true);
  EXPECT_GT(fast.pixels_needed, 1000);
  EXPECT_LE(fast.pixels_needed, fast.pixels_decoded);
  EXPECT_LT(fast.pixels_decoded,
            2.2 * static_cast<double>(fast.pixels_needed));  // few pixels: borders count
  EXPECT_GT(slow.pixels_decoded, 5 * slow.pixels_needed);    // decodes frames as a whole
  EXPECT_NEAR(static_cast<double>(fast.pixels_needed), static_cast<double>(slow.pixels_needed),
              0.02 * static_cast<double>(slow.pixels_needed));
  EXPECT_LT(counted({{"interpolation", "nearest"}}, false).pixels_needed, fast.pixels_needed);
}

TEST_F(Slabs, RefusesOptionsThatItDoesNotHave) {
  const store::Take take = write(grid_take(1, 2));
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const LightFieldRenderer renderer(take, {});
  const VirtualCamera view = view_from({0, 0, 0}, 0, 40);
  for (const schemas::OptionValues& wrong : {schemas::OptionValues{{"uv_scale", 0.0}},
                                             {{"layout", "sphere"}},
                                             {{"columns", 1.5}},
                                             {{"k", 3.0}}}) {
    EXPECT_THROW(renderer.render(view, frames, {"slabs", kPaintedPlane, wrong}), Error);
  }
}

}  // namespace
}  // namespace raystage::render::slabs_test
