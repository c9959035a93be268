// SPDX-License-Identifier: Apache-2.0
#include "render/sweep/plane_sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "render/renderer.h"
#include "render/sampling/source_view.h"
#include "render/view/synthetic_take.h"
#include "schemas/error.h"
#include "schemas/test_targets.h"

namespace raystage {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::SyntheticTake;

constexpr double kDegree = std::numbers::pi / 180;

/// More texture than the painted plane has, so that depth shows.
std::array<double, 3> texture(double x, double y) {
  const auto rgb = testing::painted_plane(1.5 * x, 1.5 * y);
  const auto fine = testing::painted_plane(4 * x + 1, 4 * y);
  return {(rgb[0] + fine[1]) / 2, (rgb[1] + fine[2]) / 2, (rgb[2] + fine[0]) / 2};
}

/// The plane n.X = c.
struct Plane {
  Eigen::Vector3d normal;
  double c;
  double distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    return (c - normal.dot(from)) / normal.dot(direction);
  }
};
const Plane kSlanted{{0.35, 0.1, 1}, -4};
const Plane kBack{{0, 0, 1}, -5}, kFront{{0, 0, 1}, -2.5};

/// Everything nearer than x = 0.1 on the front plane is a wall; behind it the back plane.
bool hits_wall(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  return (from + kFront.distance(from, direction) * direction).x() < 0.1;
}

Pose looking(const Eigen::Vector3d& position, double yaw_degrees) {
  Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(yaw_degrees * kDegree, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return pose;
}

class PlaneSweep : public ::testing::Test {
 protected:
  static SyntheticTake slanted(int rows, int columns, const Distortion& distortion = {}) {
    SyntheticTake take;
    take.cameras = testing::camera_grid(rows, columns, 0.1, 96, 72, distortion);
    take.depth_range = DepthRange{2.5, 7};
    take.painting = [](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
      const Eigen::Vector3d hit = from + kSlanted.distance(from, direction) * direction;
      return texture(hit.x(), hit.y());
    };
    return take;
  }
  static SyntheticTake step_edge() {
    SyntheticTake take = slanted(3, 3);
    take.painting = [](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
      const Plane& plane = hits_wall(from, direction) ? kFront : kBack;
      const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
      return texture(hit.x(), hit.y() + plane.c);
    };
    return take;
  }
  Take write(const SyntheticTake& settings) {
    write_synthetic_take(settings, folder_.path() / "take");
    return Take(folder_.path() / "take");
  }
  static RenderedView render(const Take& take, const VirtualCamera& view, OptionValues options = {},
                             const RendererSettings& settings = {}, int frame = 0) {
    const FrameSelection frames =
        select_frames(take, frame * kNanosecondsPerSecond / 15, 30'000'000);
    return LightFieldRenderer(take, settings)
        .render(view, frames, {"plane_sweep", {0, 0, 0, 1}, std::move(options)});
  }
  TestFolder folder_;
};

VirtualCamera a_view() {
  return virtual_camera_with_fov(90, 64, 40 * kDegree, looking({0.02, 0.013, 0.03}, 2));
}

double mean_alpha(const RenderedView& view) {
  double sum = 0;
  for (std::size_t i = 3; i < view.rgba.size(); i += 4) sum += static_cast<double>(view.rgba[i]);
  return sum / static_cast<double>(view.coverage.size());
}

/// Costs are rounded to whole numbers on either way, so where two planes are worth the same the
/// choice may differ; nearly everywhere it must not.
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
  const Take take = write(slanted(3, 3, {-0.15, 0.04, 0.001, -0.002, 0}));
  RendererSettings slow;
  slow.reference = true;
  for (const OptionValues& options :
       {OptionValues{}, OptionValues{{"aggregation", std::string("box")}, {"sub_plane", false}},
        OptionValues{{"cameras", 7.0}, {"look_up", std::string("linear")}, {"step_px", 1.0}},
        OptionValues{{"planes", 1.0}}, OptionValues{{"left_out", 1.0}},
        OptionValues{{"edge_scale", 8.0}, {"step_px", 1.0}},
        OptionValues{{"aggregation", std::string("none")}, {"truncation", 20.0}}}) {
    expect_nearly_equal(render(take, a_view(), options), render(take, a_view(), options, slow));
  }
  const OptionValues coarse{{"step_px", 2.0}};
  for (const VirtualCamera& view :
       {virtual_camera_with_fov(70, 50, 1.2, looking({0.3, 0.1, 0.4}, 15)),     // from the side
        virtual_camera_with_fov(70, 50, 0.5, looking({0, 0.05, -1.5}, -5))}) {  // in front
    expect_nearly_equal(render(take, view, coarse), render(take, view, coarse, slow));
  }
}

TEST_F(PlaneSweep, EveryInstructionSetAgreesWithTheReference) {
  const Take take = write(slanted(2, 3, {-0.15, 0.04, 0.001, -0.002, 0}));
  RendererSettings slow;
  slow.reference = true;
  const RenderedView expected = render(take, a_view(), {{"step_px", 1.0}}, slow);
  testing::for_each_target(kernel_target, [&] {
    expect_nearly_equal(render(take, a_view(), {{"step_px", 1.0}}), expected);
  });
}

struct SlantedErrors {
  double disparity = 0;  ///< mean, pixels between neighbouring cameras
  double colour = 0;     ///< mean, linear light
};

/// Of a view of slanted(), but for its border.
SlantedErrors errors_on_slanted(const RenderedView& image, const VirtualCamera& view) {
  constexpr double kPixelMetres = 80 * 0.1;  // focal length times the cameras' spacing
  const ViewRays rays(view);
  SlantedErrors errors;
  int count = 0;
  for (int y = 8; y < view.height - 8; ++y) {
    for (int x = 8; x < view.width - 8; ++x) {
      const auto at = static_cast<std::size_t>(y * view.width + x);
      const Eigen::Vector3d ray = *rays.through(x + 0.5, y + 0.5);
      const double depth = kSlanted.distance(view.pose.position, ray);
      const Eigen::Vector3d hit = view.pose.position + depth * ray;
      const auto truth = texture(hit.x(), hit.y());
      errors.disparity += std::abs(1 / static_cast<double>(image.z[at]) - 1 / depth) * kPixelMetres;
      for (std::size_t c = 0; c < 3; ++c) {
        errors.colour += std::abs(static_cast<double>(image.rgba[4 * at + c]) - truth[c]) / 3;
      }
      ++count;
    }
  }
  return {errors.disparity / count, errors.colour / count};
}

TEST_F(PlaneSweep, FindsASlantedPlane) {
  const Take take = write(slanted(3, 3));
  const VirtualCamera view = a_view();
  const RenderedView image = render(take, view);
  const SlantedErrors errors = errors_on_slanted(image, view);
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

/// With planes so far apart it is the parabola that finds what lies between.
TEST_F(PlaneSweep, FindsASlantedPlaneBetweenItsPlanes) {
  const Take take = write(slanted(3, 3));
  const VirtualCamera view = a_view();
  // Semi-global matching draws towards the neighbours' planes.
  for (const auto& [aggregation, share] : {std::pair{"semi_global", 0.65}, {"box", 0.3}}) {
    SCOPED_TRACE(aggregation);
    for (const bool reference : {false, true}) {
      RendererSettings settings;
      settings.reference = reference;
      const auto errors = [&](bool sub_plane) {
        const OptionValues options{
            {"step_px", 1.0}, {"aggregation", std::string(aggregation)}, {"sub_plane", sub_plane}};
        return errors_on_slanted(render(take, view, options, settings), view);
      };
      const SlantedErrors between = errors(true), on_planes = errors(false);
      EXPECT_GT(on_planes.disparity, 0.15);  // rounded to whole steps: a quarter of one in the mean
      EXPECT_LT(between.disparity, on_planes.disparity * share);
      EXPECT_LT(between.colour, on_planes.colour);
    }
  }
}

TEST_F(PlaneSweep, KeepsTheTwoSidesOfAStepApart) {
  const Take take = write(step_edge());
  const VirtualCamera view = a_view();
  const RenderedView image = render(take, view);
  const ViewRays rays(view);
  int wrong = 0, count = 0;
  for (int y = 4; y < view.height - 4; ++y) {
    for (int x = 4; x < view.width - 4; ++x) {
      const auto side = [&](double at) {
        return hits_wall(view.pose.position, *rays.through(at, y + 0.5));
      };
      if (side(x - 3) != side(x + 4)) continue;
      const Plane& plane = side(x + 0.5) ? kFront : kBack;
      const double depth = plane.distance(view.pose.position, *rays.through(x + 0.5, y + 0.5));
      const auto found = static_cast<double>(image.z[static_cast<std::size_t>(y * view.width + x)]);
      wrong += std::abs(found / depth - 1) > 0.05;
      ++count;
    }
  }
  EXPECT_LT(wrong, count / 50);
}

/// Something that a single camera of nine looks at, as if it stood right before its lens.
TEST_F(PlaneSweep, LeavesOutTheCameraThatSeesSomethingElse) {
  SyntheticTake settings = slanted(3, 3);
  const auto scene = settings.painting;
  settings.painting = [scene](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
    return from.norm() < 1e-9 ? std::array<double, 3>{1, 1, 1} : scene(from, direction);
  };
  const Take take = write(settings);
  const VirtualCamera view = a_view();
  const auto errors = [&](double left_out) {
    return errors_on_slanted(
               render(
                   take, view,
                   {{"left_out", left_out}, {"cameras", 6.0}, {"aggregation", std::string("box")}}),
               view)
        .disparity;
  };
  EXPECT_LT(errors(1), 0.75 * errors(0));
  EXPECT_LT(errors(1), 0.2);
}

TEST_F(PlaneSweep, SameBytesForAnyNumberOfThreadsAndAnyMemory) {
  const Take take = write(slanted(3, 3));
  std::vector<RenderedView> images;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    RendererSettings settings;
    if (threads == 5) settings.working_bytes = 0;  // the least that it can do with
    images.push_back(render(take, a_view(), {}, settings));
  }
  EXPECT_EQ(images[0].rgba, images[1].rgba);
  EXPECT_EQ(images[0].rgba, images[2].rgba);
  EXPECT_EQ(images[0].z, images[2].z);
}

TEST_F(PlaneSweep, WorksInTheMemoryThatItIsGivenAndSaysHowMuch) {
  const Take take = write(slanted(3, 3));
  const RenderedView all = render(take, a_view());
  const std::size_t wanted = all.statistics.working_bytes;
  EXPECT_GT(wanted, 500'000U);
  RendererSettings little;
  little.working_bytes = wanted * 3 / 4;
  const auto beyond =
      Contains(HasSubstr("a view of 90x64 takes more memory to work with than its share, 0 MB"));
  const RenderedView image = render(take, a_view(), {}, little);
  EXPECT_LE(image.statistics.working_bytes, little.working_bytes);
  EXPECT_EQ(image.rgba, all.rgba);
  little.working_bytes = 0;
  const RenderedView least = render(take, a_view(), {}, little);
  EXPECT_GT(least.statistics.working_bytes, 0U);
  EXPECT_LE(least.statistics.working_bytes, image.statistics.working_bytes);
  EXPECT_THAT(image.notes, Not(beyond));
  EXPECT_THAT(least.notes, beyond);
  // Boxes, too: rows of a volume for each thread, the frames' luma and the map.
  const RenderedView box = render(take, a_view(), {{"aggregation", std::string("box")}});
  EXPECT_GT(box.statistics.working_bytes, 90U * 64 * 5);
  EXPECT_LT(box.statistics.working_bytes, wanted);
  EXPECT_THAT(render(take, a_view(), {{"aggregation", std::string("box")}}, little).notes, beyond);
}

TEST_F(PlaneSweep, AnAbsentCamerasNeighboursStandInAndCoverageSaysSo) {
  SyntheticTake settings = slanted(3, 3);
  settings.frames = 2;
  settings.absent = {{4, 1}};  // the middle camera, second frame
  const Take take = write(settings);
  const VirtualCamera view = virtual_camera_with_fov(60, 40, 0.5, looking({0, 0, 0.01}, 0));
  const std::size_t middle = 20 * 60 + 30;
  EXPECT_NEAR(render(take, view).coverage[middle], 1, 1e-3);
  const RenderedView lacking = render(take, view, {}, {}, 1);
  EXPECT_NEAR(lacking.rgba[middle * 4 + 3], 1, 1e-3);  // still a picture
  EXPECT_LT(lacking.coverage[middle], 0.1);            // that owns up
  RendererSettings slow;
  slow.reference = true;
  expect_nearly_equal(lacking, render(take, view, {}, slow, 1));
}

TEST_F(PlaneSweep, DecodesLittleMoreThanItNeeds) {
  SyntheticTake settings = slanted(3, 3);
  settings.cameras = testing::camera_grid(3, 3, 0.06, 640, 480);
  settings.jpeg = {90, JpegEncodeSettings::Chroma::k420, -1};
  const Take take = write(settings);
  RendererSettings counting;
  counting.count_needed_pixels = true;
  const VirtualCamera view =
      virtual_camera_with_fov(480, 360, 40 * kDegree, looking({0, 0, 0.2}, 0));
  const RenderStatistics s = render(take, view, {}, counting).statistics;
  ASSERT_GT(s.pixels_needed, 0);
  EXPECT_LT(static_cast<double>(s.pixels_decoded) / static_cast<double>(s.pixels_needed), 1.3);
  EXPECT_GE(s.pixels_decoded, s.pixels_needed);
}

TEST_F(PlaneSweep, OneCameraIsAllThatItNeeds) {
  const Take take = write(slanted(1, 1));
  const RenderedView image = render(take, a_view());
  EXPECT_GT(mean_alpha(image), 0.9);
  const float z = image.z[32 * 90 + 45];  // mid-way in disparity: there is nothing to compare
  EXPECT_GT(z, 2.5F);
  EXPECT_LT(z, 7.0F);
}

TEST_F(PlaneSweep, StaysFiniteWhereDepthsEnd) {
  const Take take = write(slanted(2, 2));
  for (const OptionValues& options :
       {OptionValues{{"near", 4.0}, {"far", 4.0}}, OptionValues{{"far", 1e12}},
        OptionValues{{"near", 0.01}, {"step_px", 4.0}},
        OptionValues{{"near", 1e9}, {"far", 1e9}}}) {
    for (const VirtualCamera& view :
         {virtual_camera_with_fov(40, 30, 1, looking({0, 0, 0}, 0)),
          virtual_camera_with_fov(40, 30, 1, looking({0, 0, -4.5}, 0)),      // inside the scene
          virtual_camera_with_fov(40, 30, 1, looking({0.3, 0, -4}, 170)),    // looking back
          virtual_camera_with_fov(40, 30, 3, looking({0, 0, 0}, 90)),        // along the array
          virtual_camera_with_fov(1, 1, 0.001, looking({0, 0, 1e6}, 0))}) {  // far behind
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
  EXPECT_EQ(mean_alpha(render(take, virtual_camera_with_fov(40, 30, 1, looking({0, 0, -9}, 0)))),
            0);
}

TEST_F(PlaneSweep, RendersLinearBlendAndDistortedViews) {
  const Take take = write(slanted(2, 2));
  RendererSettings linear;
  linear.blend_space = BlendSpace::kLinear;
  RendererSettings slow = linear;
  slow.reference = true;
  const OptionValues coarse{{"step_px", 2.0}};
  expect_nearly_equal(render(take, a_view(), coarse, linear), render(take, a_view(), coarse, slow));
  VirtualCamera bent = a_view();
  bent.intrinsics.distortion.k1 = -0.1;
  EXPECT_GT(mean_alpha(render(take, bent, coarse)), 0.9);
}

TEST_F(PlaneSweep, SaysWhereItTriesFewerPlanesThanDisparityAsksFor) {
  const Take take = write(slanted(2, 2));
  const OptionValues deep{{"near", 0.01}};
  RendererSettings slow;
  slow.reference = true;
  const VirtualCamera view = virtual_camera_with_fov(12, 8, 1, looking({0.02, 0.013, 0.03}, 2));
  for (const RendererSettings& settings : {RendererSettings{}, slow}) {
    const RenderedView image = render(take, view, deep, settings);
    ASSERT_EQ(image.notes.size(), 1U);
    EXPECT_THAT(image.notes[0], HasSubstr("0.5 pixels from plane to plane"));
    EXPECT_THAT(image.notes[0], HasSubstr("up to 600 planes"));
    EXPECT_THAT(image.notes[0], HasSubstr("512 are tried"));
  }
  EXPECT_TRUE(render(take, view).notes.empty());
  // Who says how many knows.
  EXPECT_TRUE(render(take, view, {{"near", 0.01}, {"planes", 512.0}}).notes.empty());
}

TEST_F(PlaneSweep, SaysWhatItLacks) {
  SyntheticTake settings = slanted(2, 2);
  settings.knows_depth_range = false;
  const Take take = write(settings);
  EXPECT_THROW(render(take, a_view()), Error);
  EXPECT_THROW(render(take, a_view(), {{"near", 2.0}}), Error);
  EXPECT_THROW(render(take, a_view(), {{"near", 7.0}, {"far", 3.0}}), Error);
  EXPECT_THROW(render(take, a_view(), {{"near", 3.0}, {"far", 7.0}, {"p2", 10.0}}), Error);
  EXPECT_GT(mean_alpha(render(take, a_view(), {{"near", 3.0}, {"far", 7.0}})), 0.9);
  EXPECT_THROW(
      render(
          take, a_view(),
          {{"near", 3.0}, {"far", 7.0}, {"edge_scale", 8.0}, {"aggregation", std::string("box")}}),
      Error);
}

}  // namespace
}  // namespace raystage
