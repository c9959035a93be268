// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "render/planar/aperture_lens.h"
#include "render/renderer.h"
#include "render/sampling/source_view.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using testing::SyntheticTake;

constexpr double kDegree = std::numbers::pi / 180;

VirtualCamera view_from(const Eigen::Vector3d& position, double yaw_degrees = 0, int width = 110,
                        int height = 75, double fov_degrees = 40) {
  rig::Pose pose;
  pose.position = position;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(yaw_degrees * kDegree, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return virtual_camera_with_fov(width, height, fov_degrees * kDegree, pose);
}

class Aperture : public ::testing::Test {
 protected:
  store::Take write(const SyntheticTake& settings) {
    const auto folder = folder_.path() / std::to_string(++takes_);
    write_synthetic_take(settings, folder);
    return store::Take(folder);
  }
  testing::TestFolder folder_;
  int takes_ = 0;
};

SyntheticTake grid_take(int rows, int columns, const schemas::Distortion& distortion = {}) {
  SyntheticTake take;
  take.cameras = testing::camera_grid(rows, columns, 0.06, 160, 120, distortion);
  return take;
}

struct RenderCase {
  schemas::OptionValues options = {};
  Eigen::Vector4d plane{0, 0, 1, 4};
  int frame = 0;
  RendererOptions settings = {};
  std::string method = "aperture";
};

RenderedView render(const store::Take& take, const VirtualCamera& view, const RenderCase& asked) {
  const store::FrameSelection frames =
      store::select_frames(take, asked.frame * kNanosecondsPerSecond / 15, 30'000'000);
  return LightFieldRenderer(take, asked.settings)
      .render(view, frames, {asked.method, asked.plane, asked.options});
}

/// Renders with the fast and the reference implementation, which must agree.
RenderedView render_both(const store::Take& take, const VirtualCamera& view, RenderCase asked) {
  asked.settings.count_needed_pixels = true;
  RenderedView fast = render(take, view, asked);
  asked.settings.reference = true;
  const RenderedView reference = render(take, view, asked);
  for (std::size_t i = 0; i < fast.rgba.size(); ++i) {
    EXPECT_NEAR(fast.rgba[i], reference.rgba[i], 1e-3) << "value " << i;
    if (std::abs(fast.rgba[i] - reference.rgba[i]) > 1e-3F) return fast;
  }
  for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
    EXPECT_NEAR(fast.coverage[i], reference.coverage[i], 1e-3) << "pixel " << i;
    if (std::abs(fast.coverage[i] - reference.coverage[i]) > 1e-3F) return fast;
    if (std::isfinite(fast.z[i]) && std::isfinite(reference.z[i])) {
      EXPECT_NEAR(fast.z[i] / reference.z[i], 1, 1e-4) << "pixel " << i;
    }
  }
  EXPECT_GE(fast.statistics.pixels_decoded, fast.statistics.pixels_needed);
  return fast;
}

double mean_alpha(const RenderedView& view) {
  double sum = 0;
  for (std::size_t i = 3; i < view.rgba.size(); i += 4) sum += static_cast<double>(view.rgba[i]);
  return sum / static_cast<double>(view.coverage.size());
}

/// Returns the mean absolute difference between horizontal neighbours; blur lowers it.
double detail(const RenderedView& view) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i + 4 < view.rgba.size(); i += 4) {
    if (view.rgba[i + 3] < 0.999F || view.rgba[i + 7] < 0.999F) continue;
    sum += static_cast<double>(std::abs(view.rgba[i] - view.rgba[i + 4]));
    ++count;
  }
  return sum / count;
}

TEST_F(Aperture, AgreesWithTheReferenceFromEverywhere) {
  const store::Take take = write(grid_take(5, 5, {-0.2, 0.05, 0.001, -0.002, 0.003}));
  for (const auto& [position, yaw, fov] :
       {std::tuple{Eigen::Vector3d(0.01, 0.02, 0), 0.0, 50.0},  // on the array
        {Eigen::Vector3d(0.06, 0, 0), 0.0, 62.0},               // at a camera
        {Eigen::Vector3d(0, 0, 0.25), 3.0, 40.0},               // behind it
        {Eigen::Vector3d(0.02, 0, -0.3), -4.0, 30.0},           // in front of it
        {Eigen::Vector3d(0.25, 0, 0.5), 20.0, 60.0},            // from the side
        {Eigen::Vector3d(0, 0, 40), 0.0, 0.5}}) {               // from far behind
    for (const double radius : {0.0, 0.1}) {
      SCOPED_TRACE(position.transpose());
      const RenderedView image = render_both(take, view_from(position, yaw, 110, 75, fov),
                                             {{{"radius", radius}}, {0, 0, 1, 3}});
      EXPECT_GT(mean_alpha(image), 0.05);
    }
  }
}

TEST_F(Aperture, AgreesWithTheReferenceForEveryShapePlaneAndScale) {
  const store::Take take = write(grid_take(5, 5));
  const VirtualCamera view = view_from({0.01, 0.01, 0.1}, 2);
  for (const char* shape : {"round", "square", "hexagon", "octagon"}) {
    for (const double soft : {0.3, 1.0}) {
      SCOPED_TRACE(shape);
      render_both(
          take, view,
          {{{"radius", 0.11}, {"shape", std::string(shape)}, {"soft_edge", soft}}, {0, 0, 1, 2}});
    }
  }
  for (const Eigen::Vector4d& plane :
       {Eigen::Vector4d(0, 0, 0, 1), Eigen::Vector4d(0, 0, 1, 1e9), Eigen::Vector4d(0, 0, 1, 0.8),
        Eigen::Vector4d(0.4, 0.2, 1, 3), Eigen::Vector4d(0, 1, 0, 0.5)}) {
    SCOPED_TRACE(plane.transpose());
    render_both(take, view, {{{"radius", 0.1}}, plane});
  }
  RenderCase linear{{{"radius", 0.1}}, {0, 0, 1, 1}};
  const RenderedView perceptual = render_both(take, view, linear);
  linear.settings.blend_space = store::BlendSpace::kLinear;
  EXPECT_NE(render_both(take, view, linear).rgba, perceptual.rgba);
}

TEST_F(Aperture, EveryInstructionSetAgreesWithTheReference) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0.05, 0.001, -0.002, 0.003}));
  const store::Take without_distortion = write(grid_take(4, 4));
  testing::for_each_simd_target(kernel_target, [&] {
    render_both(take, view_from({0, 0.01, 0.1}, 2, 117, 83, 45),
                {{{"radius", 0.09}, {"shape", "hexagon"}}, {0, 0, 1, 3.7}});
    render_both(without_distortion, view_from({0, 0.01, 0.1}, 2, 1037, 11, 30),
                {{{"radius", 0.09}}, {0, 0, 1, 3.7}});
  });
}

TEST_F(Aperture, CamerasTurnedAboutTheirAxesAgreeWithTheReference) {
  for (const auto& [degrees, width, height] : {std::tuple{0.5, 160, 120},
                                               {-3.0, 160, 120},
                                               {30.0, 160, 120},
                                               {90.0, 160, 120},
                                               {180.0, 160, 120},
                                               {177.0, 160, 120},
                                               {0.0, 15, 11},
                                               {0.0, 16, 12}}) {
    SyntheticTake settings;
    settings.cameras = testing::camera_grid(3, 3, 0.06, width, height);
    for (schemas::CameraGeometry& camera : settings.cameras) {
      const double c = std::cos(degrees * kDegree), s = std::sin(degrees * kDegree);
      auto& m = camera.world_from_camera;
      m[0] = m[5] = c;
      m[1] = -s;
      m[4] = s;
    }
    const store::Take take = write(settings);
    for (const int view_width : {60, 131, 531}) {  // larger and smaller than the frames
      SCOPED_TRACE(std::to_string(degrees) + " degrees, " + std::to_string(view_width));
      const VirtualCamera view = view_from({0.003, 0.01, 0.05}, 1, view_width, view_width / 2, 32);
      const RenderedView image = render_both(take, view, {{{"radius", 0.1}}});
      EXPECT_GT(mean_alpha(image), 0.5);
    }
  }
}

TEST_F(Aperture, ASceneInFocusComesOutTrueAndAsFocalPlaneSeesIt) {
  const store::Take take = write(grid_take(5, 5));
  const VirtualCamera view = view_from({0.013, -0.02, 0.05}, 3);
  const RenderedView image = render_both(take, view, {{{"radius", 0.1}}});
  const RenderedView three = render(take, view, {{}, {0, 0, 1, 4}, 0, {}, "focal_plane"});
  const rig::CameraModel model({"v", view.width, view.height, view.intrinsics, {}, {}, {}});
  double worst = 0, apart = 0;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const auto at = static_cast<std::size_t>(y * view.width + x);
      EXPECT_EQ(image.rgba[at * 4 + 3] > 0, three.rgba[at * 4 + 3] > 0);
      if (image.rgba[at * 4 + 3] < 0.999F) continue;
      const Eigen::Vector3d ray =
          view.pose.world_from_camera_rotation * *model.unproject({x + 0.5, y + 0.5});
      const double t = (-4 - view.pose.position.z()) / ray.z();
      const Eigen::Vector3d hit = view.pose.position + t * ray;
      const auto truth = testing::painted_plane(hit.x(), hit.y());
      for (std::size_t c = 0; c < 3; ++c) {
        const double value = static_cast<double>(image.rgba[at * 4 + c]);
        worst = std::max(worst, std::abs(truth[c] - value));
        if (three.rgba[at * 4 + 3] < 0.999F) continue;
        apart = std::max(apart, std::abs(value - static_cast<double>(three.rgba[at * 4 + c])));
      }
      ASSERT_NEAR(image.z[at], t, 1e-3);
    }
  }
  EXPECT_GT(mean_alpha(image), 0.8);
  EXPECT_LT(worst, 0.03);  // JPEG's quantisation
  EXPECT_LT(apart, 0.03);
}

TEST_F(Aperture, AWiderApertureBlursWhatIsOutOfFocusOnly) {
  const store::Take take = write(grid_take(7, 7));
  const VirtualCamera view = view_from({0, 0, 0.05}, 0, 110, 75, 30);
  const auto at = [&](double radius, double depth) {
    return detail(render(take, view, {{{"radius", radius}}, {0, 0, 1, depth}}));
  };
  EXPECT_LT(at(0.18, 0.7), 0.8 * at(0, 0.7));
  EXPECT_GT(at(0.18, 4), 0.95 * at(0, 4));
}

TEST_F(Aperture, TheSmallestApertureLeavesNoHolesBetweenCameras) {
  const store::Take take = write(grid_take(4, 4));
  const VirtualCamera view = view_from({0.002, 0.001, 0.3}, 0, 90, 60, 20);
  const RenderedView three = render(take, view, {{}, {0, 0, 1, 4}, 0, {}, "focal_plane"});
  for (const double radius : {0.0, 1e-12}) {
    const RenderedView image = render_both(take, view, {{{"radius", radius}, {"soft_edge", 0.05}}});
    for (std::size_t i = 3; i < image.rgba.size(); i += 4) {
      ASSERT_EQ(image.rgba[i] > 0, three.rgba[i] > 0) << i;
    }
  }
}

TEST_F(Aperture, DegenerateArraysRender) {
  for (const auto& [rows, columns] : {std::pair{1, 4}, {4, 1}, {1, 1}, {1, 2}}) {
    for (const double radius : {0.0, 0.2}) {
      SCOPED_TRACE(std::to_string(rows) + "x" + std::to_string(columns));
      const store::Take take = write(grid_take(rows, columns));
      const RenderedView image =
          render_both(take, view_from({0.005, 0.002, 0.01}), {{{"radius", radius}}});
      EXPECT_GT(mean_alpha(image), 0.2);
    }
  }
}

TEST_F(Aperture, MissingRaysAreMissing) {
  const store::Take take = write(grid_take(3, 3));
  const RenderedView beside = render_both(take, view_from({5, 0, 0.1}), {{{"radius", 0.5}}});
  EXPECT_EQ(mean_alpha(beside), 0);
  EXPECT_EQ(beside.z[0], std::numeric_limits<float>::infinity());
  EXPECT_EQ(beside.statistics.pixels_decoded, 0);
  EXPECT_EQ(mean_alpha(render_both(take, view_from({0, 0, 0.1}), {{}, {0, 0, 1, -2}})), 0);
  EXPECT_EQ(mean_alpha(render_both(take, view_from({0, 0, 0.1}), {{}, {0, 0, 1, -0.1}})), 0);
}

TEST_F(Aperture, CoverageOwnsUpToAbsentCamerasAndLeftOutOnesDoNotCount) {
  SyntheticTake settings = grid_take(3, 3);
  settings.frames = 2;
  settings.absent = {{4, 1}};  // the middle camera, second frame
  const store::Take take = write(settings);
  const VirtualCamera view = view_from({0, 0, 0.2}, 0, 90, 90, 20);
  const std::size_t middle = 45 * 90 + 45;
  RenderCase asked{{{"radius", 0.1}}};
  EXPECT_NEAR(render_both(take, view, asked).coverage[middle], 1, 1e-5);
  asked.frame = 1;
  const RenderedView lacking = render_both(take, view, asked);
  EXPECT_NEAR(lacking.rgba[middle * 4 + 3], 1, 1e-5);
  EXPECT_LT(lacking.coverage[middle], 0.9);
  EXPECT_GT(lacking.coverage[middle], 0.1);
  asked.frame = 0;
  asked.settings.excluded_cameras = {4};
  const RenderedView without = render_both(take, view, asked);
  EXPECT_NEAR(without.coverage[middle], 1, 1e-5);
  EXPECT_LE(without.statistics.cameras_used, 8);
}

TEST_F(Aperture, SameBytesForAnyNumberOfThreadsAndWhateverIsInMemory) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0, 0, 0, 0}));
  const VirtualCamera view = view_from({0, 0.01, 0.1}, 2);
  const RenderCase asked{{{"radius", 0.1}}};
  const RenderedView first = render(take, view, asked);
  for (const std::size_t threads : {1, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const RenderedView other = render(take, view, asked);
    EXPECT_EQ(first.rgba, other.rgba);
    EXPECT_EQ(first.z, other.z);
  }
  const LightFieldRenderer renderer(take, {});
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  for (const double x : {0.03, -0.03, 0.0, 0.0}) {  // in part, then whole
    const RenderedView image = renderer.render(view_from({x, 0.01, 0.1}, 2), frames,
                                               {"aperture", asked.plane, asked.options});
    if (x == 0) {
      EXPECT_EQ(image.rgba, first.rgba);
    }
  }
}

TEST_F(Aperture, IsNamedAsPhotographersDo) {
  // 50 mm on full frame: 36 mm * fx / width.
  VirtualCamera view = view_from({0, 0, 0});
  view.intrinsics.fx = view.intrinsics.fy = view.width * 50.0 / 36;
  constexpr double kFar = std::numeric_limits<double>::infinity();
  EXPECT_NEAR(aperture_radius(view, 2, 36, kFar), 0.0125, 1e-12);
  EXPECT_NEAR(aperture_radius(view, 4, 72, kFar), 0.0125, 1e-12);
  EXPECT_NEAR(aperture_radius(view, 1, 36, 1), 0.5 / (1 / 0.05 + 1), 1e-12);

  const store::Take take = write(grid_take(3, 3));
  const VirtualCamera ours = view_from({0.01, 0, 0.1}, 5);
  const double radius = aperture_radius(ours, 0.25, 36, 3.5);
  EXPECT_EQ(render(take, ours, {{{"f_number", 0.25}, {"focus_distance", 3.5}}}).rgba,
            render(take, ours, {{{"radius", radius}}, view_parallel_plane(ours, 3.5)}).rgba);
  EXPECT_THROW(render(take, ours, {{{"f_number", 2.0}, {"radius", 0.1}}}), Error);
  // A lens that is smaller than the distance of neighbouring cameras adds a note.
  const RenderedView tiny = render(take, ours, {{{"f_number", 22.0}}});
  ASSERT_EQ(tiny.notes.size(), 1U);
  EXPECT_NE(tiny.notes[0].find("smaller than the distance between neighbouring cameras"),
            std::string::npos);
  EXPECT_TRUE(render(take, ours, {{{"radius", 0.3}}}).notes.empty());
  EXPECT_TRUE(render(take, ours, {}).notes.empty());
}

}  // namespace
}  // namespace raystage::render
