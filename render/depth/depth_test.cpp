// SPDX-License-Identifier: Apache-2.0
#include "render/depth/depth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "render/common/image_quality.h"
#include "render/depth/estimation_kernels.h"
#include "testing/render/test_depth.h"
#include "testing/test_simd_targets.h"

namespace raystage::render::depth_test {
namespace {

using testing::default_view;
using testing::expect_equal;
using testing::hits_wall;
using testing::kBack;
using testing::kFront;
using testing::kSlanted;
using testing::make_pose;
using testing::mean_alpha;
using testing::Plane;
using testing::slanted_scene;
using testing::SyntheticTake;
using testing::texture;

class Depth : public testing::DepthTest {};

TEST_F(Depth, AgreesWithTheReference) {
  const store::Take take = write(slanted(3, 3, {-0.15, 0.04, 0.001, -0.002, 0}));
  RendererOptions slow;
  slow.reference = true;
  for (const schemas::OptionValues& options :
       {schemas::OptionValues{},
        schemas::OptionValues{{"cameras", 5.0}, {"color_tolerance", 40.0}}}) {
    expect_equal(render(take, default_view(), options),
                 render(take, default_view(), options, slow));
  }
  for (const VirtualCamera& view :
       {virtual_camera_with_fov(70, 50, 1.2, make_pose({0.3, 0.1, 0.4}, 15)),     // from the side
        virtual_camera_with_fov(70, 50, 0.5, make_pose({0, 0.05, -1.5}, -5))}) {  // in front
    expect_equal(render(take, view), render(take, view, {}, slow));
  }
  RendererOptions linear;
  linear.blend_space = store::BlendSpace::kLinear;
  slow.blend_space = store::BlendSpace::kLinear;
  expect_equal(render(take, default_view(), {}, linear), render(take, default_view(), {}, slow));
}

TEST_F(Depth, EveryInstructionSetSeesTheSame) {
  const store::Take take = write(step_edge(3, 3));
  const schemas::OptionValues anew{{"store_depths", false}};
  const RenderedView expected = render(take, default_view(), anew);
  testing::for_each_simd_target(depth_estimation_target, [&] {
    const RenderedView image = render(take, default_view(), anew);
    // Rounding may decide a choice between equal depths differently, at few pixels.
    std::size_t differ = 0;
    for (std::size_t i = 0; i < image.rgba.size(); ++i) {
      differ += std::abs(image.rgba[i] - expected.rgba[i]) > 5e-3F ? 1 : 0;
    }
    EXPECT_LT(differ, image.rgba.size() / 100);
  });
}

TEST_F(Depth, FindsASlantedPlane) {
  const store::Take take = write(slanted(3, 3));
  const VirtualCamera view = default_view();
  const RenderedView image = render(take, view);
  const ViewRays rays(view);
  const double pixel_metres = 80 * 0.1;  // focal length times the cameras' spacing
  double disparity_error = 0, colour_error = 0;
  int count = 0;
  for (int y = 8; y < view.height - 8; ++y) {
    for (int x = 8; x < view.width - 8; ++x) {
      const auto at = static_cast<std::size_t>(y * view.width + x);
      const Eigen::Vector3d ray = *rays.through(x + 0.5, y + 0.5);
      const double depth = kSlanted.distance(view.pose.position, ray);
      const auto truth = slanted_scene(view.pose.position, ray);
      disparity_error += std::abs(1 / static_cast<double>(image.z[at]) - 1 / depth) * pixel_metres;
      for (std::size_t c = 0; c < 3; ++c) {
        colour_error += std::abs(static_cast<double>(image.rgba[4 * at + c]) - truth[c]) / 3;
      }
      ++count;
      EXPECT_NEAR(image.rgba[4 * at + 3], 1, 1e-3);
      EXPECT_EQ(image.coverage[at], image.rgba[4 * at + 3]);
    }
  }
  EXPECT_LT(disparity_error / count, 0.05);  // pixels
  EXPECT_LT(colour_error / count, 0.012);
}

/// Returns the light of a wall with round holes in front of the back plane: edges at every angle
/// and of every phase.
std::array<double, 3> holes_scene(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d on_wall = from + kFront.distance(from, direction) * direction;
  const bool wall = std::cos(5 * on_wall.x() + 1) + std::cos(5 * on_wall.y()) > 0.6;
  const Plane& plane = wall ? kFront : kBack;
  const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
  const auto coarse = texture(hit.x(), hit.y() + plane.c);
  const auto fine = testing::painted_plane(9 * hit.x() + 2, 7 * hit.y() + hit.x());
  return {(2 * coarse[0] + fine[2]) / 3, (2 * coarse[1] + fine[0]) / 3,
          (2 * coarse[2] + fine[1]) / 3};
}

TEST_F(Depth, TheErrorDoesNotFlickerWhenTheCameraMoves) {
  SyntheticTake settings = slanted(3, 4);
  settings.scene = holes_scene;
  settings.samples = 3;
  settings.jpeg = {75, store::JpegEncodeOptions::Chroma::k444, 0};
  const store::Take take = write(settings);
  const LightFieldRenderer renderer(take, {});
  const store::FrameSelection frames = store::select_frames(take, 0, 30'000'000);
  const auto largest_step = [&](const schemas::OptionValues& options) {
    double before = 0, largest = 0;
    for (int i = 0; i < 28; ++i) {
      const double way = 0.008 * i;  // two camera spacings in all
      schemas::CameraGeometry geometry = settings.cameras[0];
      geometry.intrinsics.fx = geometry.intrinsics.fy = 130;
      geometry.world_from_camera[3] = way - 0.13;
      geometry.world_from_camera[7] = 0.02;
      geometry.world_from_camera[11] = way / 3;
      const RenderedView image = renderer.render(virtual_camera_from_geometry(geometry), frames,
                                                 {"depth", {0, 0, 0, 1}, options});
      const double psnr = compare_images(srgb_image(image), render_camera_image(geometry, settings),
                                         coverage_mask(image))
                              .psnr_db;
      if (i > 0) largest = std::max(largest, std::abs(psnr - before));
      before = psnr;
    }
    EXPECT_GT(before, 26);
    return largest;
  };
  EXPECT_LT(largest_step({}), 0.3);                  // dB
  EXPECT_GT(largest_step({{"cameras", 2.0}}), 0.3);  // too few cameras to hide the change
}

TEST_F(Depth, KeepsTheTwoSidesOfAStepApart) {
  const store::Take take = write(step_edge(3, 3));
  const VirtualCamera view = default_view();
  const RenderedView image = render(take, view);
  const ViewRays rays(view);
  int wrong = 0, count = 0;
  for (int y = 4; y < view.height - 4; ++y) {
    for (int x = 4; x < view.width - 4; ++x) {
      const auto side = [&](double at) {
        return hits_wall(view.pose.position, *rays.through(at, y + 0.5));
      };
      if (side(x - 2) != side(x + 3)) continue;
      const Plane& plane = side(x + 0.5) ? kFront : kBack;
      const double depth = plane.distance(view.pose.position, *rays.through(x + 0.5, y + 0.5));
      const auto found = static_cast<double>(image.z[y * view.width + x]);
      wrong += std::abs(found / depth - 1) > 0.05;
      ++count;
    }
  }
  EXPECT_LT(wrong, count / 50);
}

TEST_F(Depth, TemporalLooksAtTheFramesBeforeAndAfter) {
  SyntheticTake settings = slanted(2, 3);
  settings.frames = 4;  // all equal
  const store::Take take = write(settings);
  const schemas::OptionValues steady{{"temporal", true}};
  const store::Timeline timeline = store::build_timeline(take, 15, 0);
  RendererOptions on_ticks;
  on_ticks.ticks = timeline.ticks;
  EXPECT_GT(mean_alpha(render(take, default_view(), steady, on_ticks, 0)),
            0.9);  // the first tick has none before
  const RenderedView second = render(take, default_view(), steady, on_ticks, 1);
  const RenderedView alone = render(take, default_view(), {}, {}, 1);
  for (std::size_t i = 0; i < alone.rgba.size(); ++i) {
    ASSERT_NEAR(second.rgba[i], alone.rgba[i], 1e-3) << i;
  }
  RendererOptions slow = on_ticks;
  slow.reference = true;
  expect_equal(second, render(take, default_view(), steady, slow, 1));
  EXPECT_EQ(render(take, default_view(), steady, on_ticks, 1).rgba,
            second.rgba);  // cached or read: equal
}

TEST_F(Depth, AnAbsentCamerasNeighboursStandInAndCoverageSaysSo) {
  SyntheticTake settings = slanted(3, 3);
  settings.frames = 2;
  settings.absent = {{4, 1}};  // the middle camera, second frame
  const store::Take take = write(settings);
  const schemas::OptionValues four{{"cameras", 4.0}};
  const VirtualCamera view = virtual_camera_with_fov(60, 40, 0.5, make_pose({0, 0, 0.01}, 0));
  const std::size_t middle = 20 * 60 + 30;
  EXPECT_NEAR(render(take, view, four).coverage[middle], 1, 1e-3);
  const RenderedView lacking = render(take, view, four, {}, 1);
  EXPECT_NEAR(lacking.rgba[middle * 4 + 3], 1, 1e-3);  // still opaque
  EXPECT_LT(lacking.coverage[middle], 0.1);            // and reported
  EXPECT_EQ(stored_depth_files().size(), 2U);
  RendererOptions slow;
  slow.reference = true;
  expect_equal(lacking, render(take, view, four, slow, 1));
}

TEST_F(Depth, OneCameraIsAllThatItNeeds) {
  const store::Take take = write(slanted(1, 1));
  const RenderedView image = render(take, default_view());
  EXPECT_GT(mean_alpha(image), 0.9);
  const float z = image.z[32 * 90 + 45];  // the middle in disparity: there is nothing to compare
  EXPECT_GT(z, 2.5F);
  EXPECT_LT(z, 7.0F);
}

TEST_F(Depth, StaysFiniteWhereDepthsEnd) {
  const store::Take take = write(slanted(2, 2));
  for (const schemas::OptionValues& options :
       {schemas::OptionValues{{"near", 4.0}, {"far", 4.0}}, schemas::OptionValues{{"far", 1e12}},
        schemas::OptionValues{{"near", 0.01}, {"plane_px", 4.0}},
        schemas::OptionValues{{"near", 1e9}, {"far", 1e9}}}) {
    for (const VirtualCamera& view :
         {virtual_camera_with_fov(40, 30, 1, make_pose({0, 0, 0}, 0)),
          virtual_camera_with_fov(40, 30, 1, make_pose({0, 0, -4.5}, 0)),      // inside the scene
          virtual_camera_with_fov(40, 30, 1, make_pose({0.3, 0, -4}, 170)),    // looking back
          virtual_camera_with_fov(40, 30, 3, make_pose({0, 0, 0}, 90)),        // along the array
          virtual_camera_with_fov(1, 1, 0.001, make_pose({0, 0, 1e6}, 0))}) {  // far behind
      const RenderedView image = render(take, view, options);
      for (std::size_t i = 0; i < image.coverage.size(); ++i) {
        for (std::size_t c = 0; c < 4; ++c) ASSERT_TRUE(std::isfinite(image.rgba[4 * i + c]));
        ASSERT_GE(image.coverage[i], 0);
        ASSERT_LE(image.coverage[i], 1 + 1e-6F);
        ASSERT_GT(image.z[i], 0);
      }
    }
  }
}

TEST_F(Depth, RendersDistortedViews) {
  const store::Take take = write(slanted(2, 2));
  VirtualCamera bent = default_view();
  bent.intrinsics.distortion.k1 = -0.1;
  const RenderedView image = render(take, bent);
  EXPECT_GT(mean_alpha(image), 0.9);
  const ViewRays rays(bent);
  double error = 0;
  for (int y = 8; y < 56; ++y) {
    for (int x = 8; x < 82; ++x) {
      const auto truth = slanted_scene(bent.pose.position, *rays.through(x + 0.5, y + 0.5));
      error += std::abs(static_cast<double>(image.rgba[4 * static_cast<std::size_t>(y * 90 + x)]) -
                        truth[0]);
    }
  }
  EXPECT_LT(error / (48 * 74), 0.03);
}

TEST_F(Depth, SaysWhereItTriesFewerPlanesThanDisparityAsksFor) {
  const store::Take take = write(slanted(2, 2));
  const auto notes = [&](double near, double plane_px) {
    return render(take, default_view(), {{"near", near}, {"far", 7.0}, {"plane_px", plane_px}})
        .notes;
  };
  EXPECT_THAT(notes(3, 0.5), ::testing::Not(::testing::Contains(::testing::HasSubstr("planes"))));
  EXPECT_THAT(notes(0.13, 0.1), ::testing::Contains(::testing::ContainsRegex(
                                    "depth: 0.1 px .* up to [0-9]+ planes .*; only 256 are used")));
}

TEST_F(Depth, SaysWhatItLacks) {
  SyntheticTake settings = slanted(2, 2);
  settings.depth_range = schemas::DepthRange{};
  const store::Take take = write(settings);
  EXPECT_THROW(render(take, default_view()), Error);
  EXPECT_THROW(render(take, default_view(), {{"near", 7.0}, {"far", 3.0}}), Error);
  EXPECT_GT(mean_alpha(render(take, default_view(), {{"near", 3.0}, {"far", 7.0}})), 0.9);
}

}  // namespace
}  // namespace raystage::render::depth_test
