// SPDX-License-Identifier: Apache-2.0
#include "render/sweep/plane_sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "render/sampling/source_view.h"
#include "testing/render/test_sweep.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using testing::PlaneSweep;

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

/// Expects equal views, except at few pixels. Both implementations round costs to integers, so
/// where two planes have equal costs the choice may differ.
void expect_nearly_equal(const RenderedView& fast, const RenderedView& slow) {
  std::size_t differ = 0;
  for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
    const float by = std::abs(1 / fast.z[i] - 1 / slow.z[i]);
    bool same = by < 6e-3F && std::abs(fast.coverage[i] - slow.coverage[i]) < 1e-3F;
    for (std::size_t c = 0; c < 4; ++c) {
      same &= std::abs(fast.rgba[4 * i + c] - slow.rgba[4 * i + c]) < 5e-3F;
    }
    differ += same ? 0 : 1;
  }
  EXPECT_LT(differ, fast.coverage.size() / 50);
}

TEST_F(PlaneSweep, AgreesWithTheReference) {
  const store::Take take = write(slanted(3, 3, {-0.15, 0.04, 0.001, -0.002, 0}));
  RendererOptions slow;
  slow.reference = true;
  for (const schemas::OptionValues& options :
       {schemas::OptionValues{},
        schemas::OptionValues{{"aggregation", std::string("box")}, {"subplane_refinement", false}},
        schemas::OptionValues{
            {"cameras", 7.0}, {"interpolation", std::string("linear")}, {"step_px", 1.0}},
        schemas::OptionValues{{"planes", 1.0}}, schemas::OptionValues{{"outlier_cameras", 1.0}},
        schemas::OptionValues{{"edge_scale", 8.0}, {"step_px", 1.0}},
        schemas::OptionValues{{"aggregation", std::string("none")}, {"truncation", 20.0}}}) {
    expect_nearly_equal(render(take, testing::default_view(), options),
                        render(take, testing::default_view(), options, slow));
  }
  const schemas::OptionValues coarse{{"step_px", 2.0}};
  for (const VirtualCamera& view :
       {virtual_camera_with_fov(70, 50, 1.2,
                                testing::make_pose({0.3, 0.1, 0.4}, 15)),  // from the side
        virtual_camera_with_fov(70, 50, 0.5,
                                testing::make_pose({0, 0.05, -1.5}, -5))}) {  // in front
    expect_nearly_equal(render(take, view, coarse), render(take, view, coarse, slow));
  }
}

TEST_F(PlaneSweep, EveryInstructionSetAgreesWithTheReference) {
  const store::Take take = write(slanted(2, 3, {-0.15, 0.04, 0.001, -0.002, 0}));
  RendererOptions slow;
  slow.reference = true;
  const RenderedView expected = render(take, testing::default_view(), {{"step_px", 1.0}}, slow);
  testing::for_each_simd_target(kernel_target, [&] {
    expect_nearly_equal(render(take, testing::default_view(), {{"step_px", 1.0}}), expected);
  });
}

TEST_F(PlaneSweep, FindsASlantedPlane) {
  const store::Take take = write(slanted(3, 3));
  const VirtualCamera view = testing::default_view();
  const RenderedView image = render(take, view);
  const testing::SlantedErrors errors = testing::measure_slanted_errors(image, view);
  EXPECT_LT(errors.disparity, 0.1);
  EXPECT_LT(errors.colour, 0.015);
  for (int y = 8; y < view.height - 8; ++y) {
    for (int x = 8; x < view.width - 8; ++x) {
      const auto at = static_cast<std::size_t>(y * view.width + x);
      EXPECT_NEAR(image.rgba[4 * at + 3], 1, 1e-3);
      EXPECT_EQ(image.coverage[at], image.rgba[4 * at + 3]);
    }
  }
}

/// With planes so far apart, depths between them come from the parabola.
TEST_F(PlaneSweep, FindsASlantedPlaneBetweenItsPlanes) {
  const store::Take take = write(slanted(3, 3));
  const VirtualCamera view = testing::default_view();
  // Semi-global matching favours the planes of the neighbours.
  for (const auto& [aggregation, share] : {std::pair{"semi_global", 0.65}, {"box", 0.3}}) {
    SCOPED_TRACE(aggregation);
    for (const bool reference : {false, true}) {
      RendererOptions settings;
      settings.reference = reference;
      const auto errors = [&, &aggregation = aggregation](bool sub_plane) {
        const schemas::OptionValues options{{"step_px", 1.0},
                                            {"aggregation", std::string(aggregation)},
                                            {"subplane_refinement", sub_plane}};
        return testing::measure_slanted_errors(render(take, view, options, settings), view);
      };
      const testing::SlantedErrors between = errors(true), on_planes = errors(false);
      EXPECT_GT(on_planes.disparity, 0.15);  // rounding to steps: 1/4 on average
      EXPECT_LT(between.disparity, on_planes.disparity * share);
      EXPECT_LT(between.colour, on_planes.colour);
    }
  }
}

TEST_F(PlaneSweep, SameBytesForAnyNumberOfThreadsAndAnyMemory) {
  const store::Take take = write(slanted(3, 3));
  for (const schemas::OptionValues& options :
       {schemas::OptionValues{},
        schemas::OptionValues{{"edge_scale", 8.0}, {"outlier_cameras", 1.0}}}) {
    std::vector<RenderedView> images;
    for (const std::size_t threads : {1, 2, 5}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      RendererOptions settings;
      if (threads == 5) settings.working_bytes = 0;  // the minimum of memory
      images.push_back(render(take, testing::default_view(), options, settings));
    }
    EXPECT_EQ(images[0].rgba, images[1].rgba);
    EXPECT_EQ(images[0].rgba, images[2].rgba);
    EXPECT_EQ(images[0].z, images[2].z);
  }
}

TEST_F(PlaneSweep, WorksInTheMemoryThatItIsGivenAndSaysHowMuch) {
  const store::Take take = write(slanted(3, 3));
  const RenderedView all = render(take, testing::default_view());
  const std::size_t wanted = all.statistics.working_bytes;
  EXPECT_GT(wanted, 500'000U);
  RendererOptions little;
  little.working_bytes = wanted * 3 / 4;
  const auto beyond =
      Contains(HasSubstr("a view of 90x64 needs more working memory than its budget of 0 MB"));
  const RenderedView image = render(take, testing::default_view(), {}, little);
  EXPECT_LE(image.statistics.working_bytes, little.working_bytes);
  EXPECT_EQ(image.rgba, all.rgba);
  little.working_bytes = 0;
  const RenderedView least = render(take, testing::default_view(), {}, little);
  EXPECT_GT(least.statistics.working_bytes, 0U);
  EXPECT_LE(least.statistics.working_bytes, image.statistics.working_bytes);
  EXPECT_THAT(image.notes, Not(beyond));
  EXPECT_THAT(least.notes, beyond);
  // Box matching needs rows of a volume for each thread, the frames' luma and the map.
  const RenderedView box =
      render(take, testing::default_view(), {{"aggregation", std::string("box")}});
  EXPECT_GT(box.statistics.working_bytes, 90U * 64 * 5);
  EXPECT_LT(box.statistics.working_bytes, wanted);
  EXPECT_THAT(
      render(take, testing::default_view(), {{"aggregation", std::string("box")}}, little).notes,
      beyond);
}

TEST_F(PlaneSweep, AnAbsentCamerasNeighboursStandInAndCoverageSaysSo) {
  testing::SyntheticTake settings = slanted(3, 3);
  settings.frames = 2;
  settings.absent = {{4, 1}};  // the middle camera, second frame
  const store::Take take = write(settings);
  const VirtualCamera view =
      virtual_camera_with_fov(60, 40, 0.5, testing::make_pose({0, 0, 0.01}, 0));
  const std::size_t middle = 20 * 60 + 30;
  EXPECT_NEAR(render(take, view).coverage[middle], 1, 1e-3);
  const RenderedView lacking = render(take, view, {}, {}, 1);
  EXPECT_NEAR(lacking.rgba[middle * 4 + 3], 1, 1e-3);  // still opaque
  EXPECT_LT(lacking.coverage[middle], 0.1);            // and the missing camera is reported
  RendererOptions slow;
  slow.reference = true;
  expect_nearly_equal(lacking, render(take, view, {}, slow, 1));
}

TEST_F(PlaneSweep, DecodesLittleMoreThanItNeeds) {
  testing::SyntheticTake settings = slanted(3, 3);
  settings.cameras = testing::camera_grid(3, 3, 0.06, 640, 480);
  settings.jpeg = {90, store::JpegEncodeOptions::Chroma::k420, -1};
  const store::Take take = write(settings);
  RendererOptions counting;
  counting.count_needed_pixels = true;
  const VirtualCamera view =
      virtual_camera_with_fov(480, 360, 40 * testing::kDegree, testing::make_pose({0, 0, 0.2}, 0));
  const RenderStatistics s = render(take, view, {}, counting).statistics;
  ASSERT_GT(s.pixels_needed, 0);
  EXPECT_LT(static_cast<double>(s.pixels_decoded) / static_cast<double>(s.pixels_needed), 1.3);
  EXPECT_GE(s.pixels_decoded, s.pixels_needed);
}

TEST_F(PlaneSweep, OneCameraIsAllThatItNeeds) {
  const store::Take take = write(slanted(1, 1));
  const RenderedView image = render(take, testing::default_view());
  EXPECT_GT(testing::mean_alpha(image), 0.9);
  const float z = image.z[32 * 90 + 45];  // the middle in disparity: there is nothing to compare
  EXPECT_GT(z, 2.5F);
  EXPECT_LT(z, 7.0F);
}

TEST_F(PlaneSweep, StaysFiniteWhereDepthsEnd) {
  const store::Take take = write(slanted(2, 2));
  for (const schemas::OptionValues& options :
       {schemas::OptionValues{{"near", 4.0}, {"far", 4.0}}, schemas::OptionValues{{"far", 1e12}},
        schemas::OptionValues{{"near", 0.01}, {"step_px", 4.0}},
        schemas::OptionValues{{"near", 1e9}, {"far", 1e9}}}) {
    for (const VirtualCamera& view :
         {virtual_camera_with_fov(40, 30, 1, testing::make_pose({0, 0, 0}, 0)),
          virtual_camera_with_fov(40, 30, 1,
                                  testing::make_pose({0, 0, -4.5}, 0)),  // inside the scene
          virtual_camera_with_fov(40, 30, 1,
                                  testing::make_pose({0.3, 0, -4}, 170)),         // looking back
          virtual_camera_with_fov(40, 30, 3, testing::make_pose({0, 0, 0}, 90)),  // along the array
          virtual_camera_with_fov(1, 1, 0.001,
                                  testing::make_pose({0, 0, 1e6}, 0))}) {  // far behind
      const RenderedView image = render(take, view, options);
      for (std::size_t i = 0; i < image.coverage.size(); ++i) {
        for (std::size_t c = 0; c < 4; ++c) ASSERT_TRUE(std::isfinite(image.rgba[4 * i + c]));
        ASSERT_GE(image.coverage[i], 0);
        ASSERT_LE(image.coverage[i], 1 + 1e-6F);
        ASSERT_GT(image.z[i], 0);
      }
    }
  }
  // The far end of the scene lies behind the eye.
  EXPECT_EQ(testing::mean_alpha(render(
                take, virtual_camera_with_fov(40, 30, 1, testing::make_pose({0, 0, -9}, 0)))),
            0);
}

TEST_F(PlaneSweep, RendersLinearBlendAndDistortedViews) {
  const store::Take take = write(slanted(2, 2));
  RendererOptions linear;
  linear.blend_space = store::BlendSpace::kLinear;
  RendererOptions slow = linear;
  slow.reference = true;
  const schemas::OptionValues coarse{{"step_px", 2.0}};
  expect_nearly_equal(render(take, testing::default_view(), coarse, linear),
                      render(take, testing::default_view(), coarse, slow));
  VirtualCamera bent = testing::default_view();
  bent.intrinsics.distortion.k1 = -0.1;
  EXPECT_GT(testing::mean_alpha(render(take, bent, coarse)), 0.9);
}

TEST_F(PlaneSweep, SaysWhereItTriesFewerPlanesThanDisparityAsksFor) {
  const store::Take take = write(slanted(2, 2));
  const schemas::OptionValues deep{{"near", 0.01}};
  RendererOptions slow;
  slow.reference = true;
  const VirtualCamera view =
      virtual_camera_with_fov(12, 8, 1, testing::make_pose({0.02, 0.013, 0.03}, 2));
  for (const RendererOptions& settings : {RendererOptions{}, slow}) {
    const RenderedView image = render(take, view, deep, settings);
    ASSERT_EQ(image.notes.size(), 1U);
    EXPECT_THAT(image.notes[0], HasSubstr("0.5 px between planes"));
    EXPECT_THAT(image.notes[0], HasSubstr("up to 600 planes"));
    EXPECT_THAT(image.notes[0], HasSubstr("only 512 are used"));
  }
  EXPECT_TRUE(render(take, view).notes.empty());
  // A given number of planes causes no note.
  EXPECT_TRUE(render(take, view, {{"near", 0.01}, {"planes", 512.0}}).notes.empty());
}

TEST_F(PlaneSweep, SaysWhatItLacks) {
  testing::SyntheticTake settings = slanted(2, 2);
  settings.has_depth_range = false;
  const store::Take take = write(settings);
  EXPECT_THROW(render(take, testing::default_view()), Error);
  EXPECT_THROW(render(take, testing::default_view(), {{"near", 2.0}}), Error);
  EXPECT_THROW(render(take, testing::default_view(), {{"near", 7.0}, {"far", 3.0}}), Error);
  EXPECT_THROW(render(take, testing::default_view(), {{"near", 3.0}, {"far", 7.0}, {"p2", 10.0}}),
               Error);
  EXPECT_GT(
      testing::mean_alpha(render(take, testing::default_view(), {{"near", 3.0}, {"far", 7.0}})),
      0.9);
  EXPECT_THROW(
      render(
          take, testing::default_view(),
          {{"near", 3.0}, {"far", 7.0}, {"edge_scale", 8.0}, {"aggregation", std::string("box")}}),
      Error);
}

}  // namespace
}  // namespace raystage::render
