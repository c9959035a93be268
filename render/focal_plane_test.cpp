// SPDX-License-Identifier: Apache-2.0
#include "render/planar/focal_plane.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "render/sampling/source_view.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"
#include "testing/test_simd_targets.h"

namespace raystage::render::focal_plane_test {
namespace {

using testing::kDegree;
using testing::make_pose;
using testing::SyntheticTake;

/// Views of the fast and the reference implementation.
struct FastAndReference {
  RenderedView fast, reference;
};

FastAndReference render_both(const store::Take& take, const VirtualCamera& view,
                             const Eigen::Vector4d& plane, int frame = 0,
                             std::vector<int> excluded_cameras = {},
                             store::BlendSpace space = store::BlendSpace::kPerceptual,
                             const std::string& method = "focal_plane") {
  const store::FrameSelection frames =
      store::select_frames(take, frame * kNanosecondsPerSecond / 15, 30'000'000);
  RendererOptions options;
  options.excluded_cameras = std::move(excluded_cameras);
  options.count_needed_pixels = true;
  options.blend_space = space;
  FastAndReference pair;
  pair.fast = LightFieldRenderer(take, options).render(view, frames, {method, plane});
  options.reference = true;
  pair.reference = LightFieldRenderer(take, options).render(view, frames, {method, plane});
  return pair;
}

void expect_equal(const FastAndReference& pair) {
  double worst = 0;
  for (std::size_t i = 0; i < pair.fast.rgba.size(); ++i) {
    worst =
        std::max(worst, static_cast<double>(std::abs(pair.fast.rgba[i] - pair.reference.rgba[i])));
  }
  EXPECT_LT(worst, 1e-3);
  for (std::size_t i = 0; i < pair.fast.coverage.size(); ++i) {
    ASSERT_NEAR(pair.fast.coverage[i], pair.reference.coverage[i], 1e-3) << "pixel " << i;
    if (std::isfinite(pair.fast.z[i]) && std::isfinite(pair.reference.z[i])) {
      ASSERT_NEAR(pair.fast.z[i] / pair.reference.z[i], 1, 1e-4) << "pixel " << i;
    }
  }
}

double mean_alpha(const RenderedView& view) {
  double sum = 0;
  for (std::size_t i = 3; i < view.rgba.size(); i += 4) sum += static_cast<double>(view.rgba[i]);
  return sum / static_cast<double>(view.coverage.size());
}

class FocalPlane : public ::testing::Test {
 protected:
  store::Take write(const SyntheticTake& options) {
    write_synthetic_take(options, folder_.path() / "take");
    return store::Take(folder_.path() / "take");
  }
  testing::TestFolder folder_;
};

SyntheticTake grid_take(int rows, int columns, const schemas::Distortion& distortion = {}) {
  SyntheticTake take;
  take.cameras = testing::camera_grid(rows, columns, 0.06, 160, 120, distortion);
  return take;
}

TEST_F(FocalPlane, AgreesWithTheReferenceFromEverywhere) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0.05, 0.001, -0.002, 0.003}));
  const Eigen::Vector4d plane(0, 0, 1, 4);
  for (const auto& [position, yaw, pitch, fov] :
       {std::tuple{Eigen::Vector3d(0.01, 0.02, 0), 0.0, 0.0, 50.0},  // on the array
        {Eigen::Vector3d(0.03, 0.03, 0), 0.0, 0.0, 62.0},            // at a camera
        {Eigen::Vector3d(0, 0, 0.25), 3.0, -2.0, 40.0},              // behind it
        {Eigen::Vector3d(0.02, 0, -0.3), -4.0, 1.0, 30.0},           // in front of it
        {Eigen::Vector3d(0.25, 0, 0.5), 20.0, 0.0, 60.0},            // from the side
        {Eigen::Vector3d(0, 0, 40), 0.0, 0.0, 0.5}}) {               // from far behind
    SCOPED_TRACE(position.transpose());
    const FastAndReference pair = render_both(
        take, virtual_camera_with_fov(150, 100, fov * kDegree, make_pose(position, yaw, pitch)),
        plane);
    expect_equal(pair);
    EXPECT_GT(mean_alpha(pair.fast), 0.05);
  }
}

TEST_F(FocalPlane, AgreesWithTheReferenceForAnyPlane) {
  const store::Take take = write(grid_take(3, 3, {-0.1, 0, 0, 0, 0}));
  const VirtualCamera view =
      virtual_camera_with_fov(120, 90, 45 * kDegree, make_pose({0.01, 0.01, 0.05}, 2));
  for (const Eigen::Vector4d& plane :
       {Eigen::Vector4d(0, 0, 0, 1), Eigen::Vector4d(0, 0, 1, 1e9), Eigen::Vector4d(0, 0, 1, 0.8),
        Eigen::Vector4d(0.4, 0.2, 1, 3), Eigen::Vector4d(0, 1, 0, 0.5)}) {
    SCOPED_TRACE(plane.transpose());
    expect_equal(render_both(take, view, plane));
  }
}

TEST_F(FocalPlane, AgreesWithTheReferenceForEverySampling) {
  for (const auto chroma :
       {store::JpegEncodeOptions::Chroma::k444, store::JpegEncodeOptions::Chroma::k422,
        store::JpegEncodeOptions::Chroma::k420}) {
    for (const int interval : {0, -1, 1, 7}) {
      SyntheticTake options = grid_take(3, 3);
      options.jpeg = {80, chroma, interval};
      const auto folder = folder_.path() / (std::to_string(static_cast<int>(chroma)) + "_" +
                                            std::to_string(interval));
      write_synthetic_take(options, folder);
      const store::Take take(folder);
      expect_equal(render_both(
          take, virtual_camera_with_fov(120, 90, 30 * kDegree, make_pose({0.01, 0.01, 0.4}, 2)),
          {0, 0, 1, 4}));
    }
  }
}

TEST_F(FocalPlane, ASceneOnThePlaneComesOutTrue) {
  const store::Take take = write(grid_take(4, 4, {-0.15, 0.02, 0, 0, 0}));
  const VirtualCamera view =
      virtual_camera_with_fov(160, 120, 45 * kDegree, make_pose({0.013, -0.02, 0.02}, 3));
  const FastAndReference pair = render_both(take, view, {0, 0, 1, 4});
  double worst = 0;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y * view.width + x);
      if (pair.fast.rgba[at * 4 + 3] < 0.999F) continue;
      const auto ray = rig::CameraModel({"v", view.width, view.height, view.intrinsics, {}, {}, {}})
                           .unproject({x + 0.5, y + 0.5});
      const Eigen::Vector3d direction = view.pose.world_from_camera_rotation * *ray;
      const double t = (-4 - view.pose.position.z()) / direction.z();
      const Eigen::Vector3d hit = view.pose.position + t * direction;
      const auto truth = testing::painted_plane(hit.x(), hit.y());
      for (std::size_t c = 0; c < 3; ++c) {
        worst =
            std::max(worst, std::abs(truth[c] - static_cast<double>(pair.fast.rgba[at * 4 + c])));
      }
      ASSERT_NEAR(pair.fast.z[at], t, 1e-3);
    }
  }
  EXPECT_GT(mean_alpha(pair.fast), 0.9);
  EXPECT_LT(worst, 0.03);  // JPEG's quantisation
}

TEST_F(FocalPlane, MissingRaysAreMissing) {
  const store::Take take = write(grid_take(3, 3));
  const VirtualCamera beside =  // looks past the array's edge
      virtual_camera_with_fov(60, 40, 50 * kDegree, make_pose({5, 0, 0.1}, 0));
  const FastAndReference nothing = render_both(take, beside, {0, 0, 1, 4});
  expect_equal(nothing);
  EXPECT_EQ(mean_alpha(nothing.fast), 0);
  EXPECT_EQ(nothing.fast.coverage[0], 0);
  EXPECT_EQ(nothing.fast.z[0], std::numeric_limits<float>::infinity());
  EXPECT_EQ(nothing.fast.statistics.pixels_decoded, 0);

  const FastAndReference behind = render_both(  // the focal plane lies behind the view
      take, virtual_camera_with_fov(60, 40, 50 * kDegree, make_pose({0, 0, 0.1}, 0)),
      {0, 0, 1, -2});
  EXPECT_EQ(mean_alpha(behind.fast), 0);
  const FastAndReference through = render_both(  // ... and through its eye
      take, virtual_camera_with_fov(60, 40, 50 * kDegree, make_pose({0, 0, 0.1}, 0)),
      {0, 0, 1, -0.1});
  EXPECT_EQ(mean_alpha(through.fast), 0);
}

TEST_F(FocalPlane, DegenerateArraysRender) {
  for (const auto& [rows, columns] : {std::pair{1, 4}, {4, 1}, {1, 1}, {1, 2}}) {
    SCOPED_TRACE(std::to_string(rows) + "x" + std::to_string(columns));
    const auto folder = folder_.path() / (std::to_string(rows) + std::to_string(columns));
    write_synthetic_take(grid_take(rows, columns), folder);
    const store::Take take(folder);
    const FastAndReference pair = render_both(
        take, virtual_camera_with_fov(80, 60, 40 * kDegree, make_pose({0.005, 0.002, 0.01}, 0)),
        {0, 0, 1, 4});
    expect_equal(pair);
    EXPECT_GT(mean_alpha(pair.fast), 0.2);
  }
}

TEST_F(FocalPlane, AnAbsentCamerasNeighboursStandInAndCoverageSaysSo) {
  SyntheticTake options = grid_take(3, 3);
  options.frames = 2;
  options.absent = {{4, 1}};  // the middle camera, second frame
  const store::Take take = write(options);
  const VirtualCamera view =
      virtual_camera_with_fov(90, 90, 20 * kDegree, make_pose({0, 0, 0.2}, 0));
  const FastAndReference whole = render_both(take, view, {0, 0, 1, 4}, 0);
  const FastAndReference lacking = render_both(take, view, {0, 0, 1, 4}, 1);
  expect_equal(whole);
  expect_equal(lacking);
  const std::size_t middle = 45 * 90 + 45;
  EXPECT_NEAR(whole.fast.coverage[middle], 1, 1e-5);
  EXPECT_NEAR(lacking.fast.rgba[middle * 4 + 3], 1, 1e-5);  // still opaque
  EXPECT_LT(lacking.fast.coverage[middle], 0.1);            // and the missing camera is reported
}

TEST_F(FocalPlane, LeftOutCamerasDoNotCount) {
  const store::Take take = write(grid_take(3, 3));
  const VirtualCamera view =
      virtual_camera_with_fov(90, 90, 20 * kDegree, make_pose({0, 0, 0.2}, 0));
  const FastAndReference pair = render_both(take, view, {0, 0, 1, 4}, 0, {4});
  expect_equal(pair);
  EXPECT_NEAR(pair.fast.coverage[45 * 90 + 45], 1, 1e-5);
  EXPECT_LE(pair.fast.statistics.cameras_used, 8);
  EXPECT_THROW(render_both(take, view, {0, 0, 1, 4}, 0, {0, 1, 2, 3, 4, 5, 6, 7, 8}), Error);
}

TEST_F(FocalPlane, PhotometricCorrectionIsAppliedAndMayExceedFullScale) {
  SyntheticTake options = grid_take(2, 2);
  options.photometric.contrast = {1.6, 0.9, 1.2};
  options.photometric.brightness = {-0.02, 0.01, 0};
  const store::Take take = write(options);
  const VirtualCamera view =
      virtual_camera_with_fov(80, 60, 40 * kDegree, make_pose({0.005, 0.002, 0.01}, 0));
  const FastAndReference pair = render_both(take, view, {0, 0, 1, 4});
  expect_equal(pair);
  const auto ray = Eigen::Vector3d(0, 0, -1);
  const auto truth = testing::painted_plane(0.005 + 0 * ray.x(), 0.002);
  const std::size_t middle = 30 * 80 + 40;
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(pair.fast.rgba[middle * 4 + c], truth[c], 0.04);
  }
}

TEST_F(FocalPlane, SameBytesForAnyNumberOfThreads) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0, 0, 0, 0}));
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const VirtualCamera view = virtual_camera_with_fov(160, 120, 0.8, make_pose({0, 0.01, 0.1}, 2));
  std::vector<RenderedView> images;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    images.push_back(
        LightFieldRenderer(take, {}).render(view, frames, {"focal_plane", {0, 0, 1, 4}}));
  }
  EXPECT_EQ(images[0].rgba, images[1].rgba);
  EXPECT_EQ(images[0].rgba, images[2].rgba);
  EXPECT_EQ(images[0].z, images[2].z);
}

TEST_F(FocalPlane, EveryInstructionSetAgreesWithTheReference) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0.05, 0.001, -0.002, 0.003}));
  const VirtualCamera view = virtual_camera_with_fov(117, 83, 0.8, make_pose({0, 0.01, 0.1}, 2));
  testing::for_each_simd_target(kernel_target, [&] {
    expect_equal(render_both(take, view, {0, 0, 1, 3.7}));
  });
}

TEST_F(FocalPlane, ATinyCacheOnlyCostsTime) {
  const store::Take take = write(grid_take(4, 4));
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const VirtualCamera view = virtual_camera_with_fov(160, 120, 0.8, make_pose({0, 0.01, 0.1}, 2));
  RendererOptions tiny;
  tiny.cache_bytes = 1;
  const auto large =
      LightFieldRenderer(take, {}).render(view, frames, {"focal_plane", {0, 0, 1, 4}});
  const LightFieldRenderer renderer(take, tiny);
  for (int again = 0; again < 3; ++again) {
    EXPECT_EQ(renderer.render(view, frames, {"focal_plane", {0, 0, 1, 4}}).rgba, large.rgba);
  }
}

TEST_F(FocalPlane, DecodesLittleMoreThanItNeeds) {
  SyntheticTake options;
  options.cameras = testing::camera_grid(4, 4, 0.06, 640, 480);
  options.jpeg = {90, store::JpegEncodeOptions::Chroma::k420, -1};
  const store::Take take = write(options);
  const VirtualCamera view =
      virtual_camera_with_fov(480, 360, 40 * kDegree, make_pose({0, 0, 0.2}, 0));
  const FastAndReference pair = render_both(take, view, {0, 0, 1, 4});
  const RenderStatistics& s = pair.fast.statistics;
  ASSERT_GT(s.pixels_needed, 0);
  EXPECT_LT(static_cast<double>(s.pixels_decoded) / static_cast<double>(s.pixels_needed), 1.3);
  EXPECT_GE(s.pixels_decoded, s.pixels_needed);
}

TEST_F(FocalPlane, BothBlendSpacesAgreeWithTheReference) {
  const store::Take take = write(grid_take(3, 3));
  const VirtualCamera view =
      virtual_camera_with_fov(90, 70, 30 * kDegree, make_pose({0.01, 0.02, 0.2}, 1));
  const Eigen::Vector4d ghosting(0, 0, 1, 1);  // far from the painted plane: the samples differ
  const FastAndReference perceptual = render_both(take, view, ghosting);
  const FastAndReference linear =
      render_both(take, view, ghosting, 0, {}, store::BlendSpace::kLinear);
  expect_equal(perceptual);
  expect_equal(linear);
  EXPECT_NE(perceptual.fast.rgba, linear.fast.rgba);
}

TEST_F(FocalPlane, WhatIsInMemoryIsNotPlannedForAgain) {
  const store::Take take = write(grid_take(3, 3));
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const LightFieldRenderer renderer(take, {});
  std::vector<RenderedView> views;
  for (int again = 0; again < 4; ++again) {  // a part, the whole, then from memory
    const VirtualCamera view =
        virtual_camera_with_fov(90, 70, 0.5, make_pose({0.01 * again, 0.02, 0.2}, 1));
    const RenderedView image = renderer.render(view, frames, {"focal_plane", {0, 0, 1, 4}});
    EXPECT_EQ(
        image.rgba,
        LightFieldRenderer(take, {}).render(view, frames, {"focal_plane", {0, 0, 1, 4}}).rgba);
    if (again == 3) {
      EXPECT_EQ(image.statistics.pixels_decoded, 0);
    }
  }
}

TEST_F(FocalPlane, AFrameWithoutRestartMarkersIsNotTakenForWholeEither) {
  SyntheticTake options = grid_take(3, 3);
  options.jpeg.restart_interval = 0;
  const store::Take take = write(options);
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const LightFieldRenderer renderer(take, {});
  for (const double yaw : {-12.0, 12.0}) {  // other parts of the frames
    const VirtualCamera view = virtual_camera_with_fov(60, 40, 0.2, make_pose({0, 0.01, 0.2}, yaw));
    EXPECT_EQ(
        renderer.render(view, frames, {"focal_plane", {0, 0, 1, 4}}).rgba,
        LightFieldRenderer(take, {}).render(view, frames, {"focal_plane", {0, 0, 1, 4}}).rgba);
  }
}

TEST_F(FocalPlane, RefusesAnUnknownMethod) {
  EXPECT_THROW(method_named("magic"), Error);
  for (const Method* method : methods()) EXPECT_EQ(&method_named(method->name()), method);
}

TEST_F(FocalPlane, NearestAgreesWithTheReferenceButWhereItCuts) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0.05, 0.001, -0.002, 0.003}));
  const Eigen::Vector4d ghosting(0, 0, 1, 1);  // the samples differ
  for (const auto& [position, fov] :
       {std::pair{Eigen::Vector3d(0.01, 0.02, 0), 50.0}, {Eigen::Vector3d(0, 0, 0.25), 40.0}}) {
    const VirtualCamera view =
        virtual_camera_with_fov(150, 100, fov * kDegree, make_pose(position, 3, -2));
    const FastAndReference pair =
        render_both(take, view, ghosting, 0, {}, store::BlendSpace::kPerceptual, "nearest");
    std::size_t differ = 0;
    for (std::size_t i = 0; i < pair.fast.rgba.size(); i += 4) {
      const float by = std::abs(pair.fast.rgba[i] - pair.reference.rgba[i]);
      differ += by > 1e-3F ? 1 : 0;
    }
    EXPECT_LT(differ, pair.fast.coverage.size() / 500);  // float and double cut at other pixels
    const FastAndReference blended = render_both(take, view, ghosting);
    EXPECT_NE(pair.fast.rgba, blended.fast.rgba);
    EXPECT_LE(pair.fast.statistics.pixels_needed, blended.fast.statistics.pixels_needed);
  }
}

}  // namespace
}  // namespace raystage::render::focal_plane_test
