// SPDX-License-Identifier: Apache-2.0
#include "render/lumigraph/lumigraph.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <set>

#include "base/atomic_file.h"
#include "base/error.h"
#include "render/common/ray_cells.h"
#include "render/renderer.h"
#include "render/sampling/source_view.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"
#include "testing/render/test_views.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using testing::mean_alpha;

using Eigen::Vector3d;
using testing::kDegree;
using testing::make_pose;
using testing::SyntheticTake;

struct FastAndReference {
  RenderedView fast, reference;
};

FastAndReference render_both(const store::Take& take, const VirtualCamera& view,
                             const Eigen::Vector4d& plane,
                             const schemas::OptionValues& options = {}, int frame = 0) {
  const store::FrameSelection frames =
      store::select_frames(take, frame * kNanosecondsPerSecond / 15, 30'000'000);
  RendererOptions settings;
  settings.count_needed_pixels = true;
  const ReconstructionOptions reconstruction{"lumigraph", plane, options};
  FastAndReference pair;
  pair.fast = LightFieldRenderer(take, settings).render(view, frames, reconstruction);
  settings.reference = true;
  pair.reference = LightFieldRenderer(take, settings).render(view, frames, reconstruction);
  return pair;
}

void expect_equal(const FastAndReference& pair) {
  double worst = 0;
  for (std::size_t i = 0; i < pair.fast.rgba.size(); ++i) {
    worst =
        std::max(worst, static_cast<double>(std::abs(pair.fast.rgba[i] - pair.reference.rgba[i])));
  }
  EXPECT_LT(worst, 2e-3);
  for (std::size_t i = 0; i < pair.fast.coverage.size(); ++i) {
    ASSERT_NEAR(pair.fast.coverage[i], pair.reference.coverage[i], 2e-3) << "pixel " << i;
    if (!(pair.fast.rgba[4 * i + 3] > 0)) {
      ASSERT_EQ(pair.fast.z[i], std::numeric_limits<float>::infinity()) << "pixel " << i;
    }
    if (std::isfinite(pair.fast.z[i]) && std::isfinite(pair.reference.z[i])) {
      ASSERT_NEAR(pair.fast.z[i] / pair.reference.z[i], 1, 1e-4) << "pixel " << i;
    }
  }
}

class Lumigraph : public ::testing::Test {
 protected:
  store::Take write(const SyntheticTake& settings) {
    write_synthetic_take(settings, folder_.path() / "take");
    return store::Take(folder_.path() / "take");
  }
  testing::TestFolder folder_;
};

SyntheticTake grid_take(int rows, int columns, const schemas::Distortion& distortion = {}) {
  SyntheticTake take;
  take.cameras = testing::camera_grid(rows, columns, 0.06, 160, 120, distortion);
  return take;
}

TEST_F(Lumigraph, AgreesWithTheReferenceFromEverywhere) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0.05, 0.001, -0.002, 0.003}));
  for (const auto& [position, yaw, pitch, fov] :
       {std::tuple{Vector3d(0.01, 0.02, 0), 0.0, 0.0, 50.0},  // on the array
        {Vector3d(0.03, 0.03, 0), 0.0, 0.0, 62.0},            // at a camera
        {Vector3d(0, 0, 0.25), 3.0, -2.0, 40.0},              // behind it
        {Vector3d(0.02, 0, -0.3), -4.0, 1.0, 30.0},           // in front of it
        {Vector3d(0.25, 0, 0.5), 20.0, 0.0, 60.0},            // from the side
        {Vector3d(0, 0, 40), 0.0, 0.0, 0.5}}) {               // from far behind
    SCOPED_TRACE(position.transpose());
    const FastAndReference pair = render_both(
        take, virtual_camera_with_fov(150, 100, fov * kDegree, make_pose(position, yaw, pitch)),
        {0, 0, 1, 4});
    expect_equal(pair);
    EXPECT_GT(mean_alpha(pair.fast), 0.05);
  }
}

TEST_F(Lumigraph, AgreesWithTheReferenceOnEveryInstructionSet) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0.05, 0.001, -0.002, 0.003}));
  testing::for_each_simd_target(kernel_target, [&] {
    expect_equal(render_both(
        take, virtual_camera_with_fov(117, 83, 45 * kDegree, make_pose({0, 0.01, 0.1}, 2, 40)),
        {0.1, 0, 1, 3.7}));
    // Neighbours in the view are far apart in the frames.
    expect_equal(render_both(
        take, virtual_camera_with_fov(40, 30, 1, make_pose({0, 0.01, 0.1}, 2, 1)), {0, 0, 1, 4}));
  });
}

TEST_F(Lumigraph, AgreesWithTheReferenceOnEveryPlane) {
  const store::Take take = write(grid_take(3, 3));
  const VirtualCamera view =
      virtual_camera_with_fov(90, 70, 40 * kDegree, make_pose({0.01, 0.02, 0.1}, 3, 2));
  for (const Eigen::Vector4d& plane :
       {Eigen::Vector4d(0, 0, 0, 1), Eigen::Vector4d(0, 0, 1, 1e9), Eigen::Vector4d(0, 0, 1, 0.8),
        Eigen::Vector4d(0.4, 0.2, 1, 3), Eigen::Vector4d(0, 1, 0, 0.5)}) {
    SCOPED_TRACE(plane.transpose());
    const FastAndReference pair = render_both(take, view, plane);
    expect_equal(pair);
    EXPECT_GT(mean_alpha(pair.fast), 0.05);
  }
}

TEST_F(Lumigraph, ASceneOnThePlaneComesOutTrueOnAMeshToo) {
  const store::Take take = write(grid_take(4, 4, {-0.15, 0.02, 0, 0, 0}));
  write_file_atomically(take.folder() / "wall.obj",
                        "v -9 -9 -4\nv 9 -9 -4\nv 9 9 -4\nv -9 9 -4\nf 1 2 3 4\n");
  const VirtualCamera view =
      virtual_camera_with_fov(160, 120, 45 * kDegree, make_pose({0.013, -0.02, 0.02}, 3));
  const Eigen::Vector4d wrong(0, 0, 1, 1);  // the mesh is in front of this plane
  for (const auto& [plane, options] :
       {std::pair{Eigen::Vector4d(0, 0, 1, 4), schemas::OptionValues{}},
        {wrong, {{"proxy", std::string("mesh")}, {"mesh", std::string("wall.obj")}}}}) {
    const FastAndReference pair = render_both(take, view, plane, options);
    expect_equal(pair);
    double worst = 0;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const std::size_t at = static_cast<std::size_t>(y * view.width + x);
        if (pair.fast.rgba[at * 4 + 3] < 0.999F) continue;
        const Vector3d direction = world_ray_from_pixel(view) * Vector3d(x + 0.5, y + 0.5, 1);
        const double t = (-4 - view.pose.position.z()) / direction.z();
        const Vector3d hit = view.pose.position + t * direction;
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
}

TEST_F(Lumigraph, BeyondAMeshThePlaneIsLookedAt) {
  const store::Take take = write(grid_take(3, 3));
  write_file_atomically(take.folder() / "patch.obj",
                        "v -0.3 -0.3 -3\nv 0.3 -0.3 -3\nv 0.3 0.3 -3\nf 1 2 3\n");
  const FastAndReference pair = render_both(
      take, virtual_camera_with_fov(90, 90, 40 * kDegree, make_pose({0, 0, 0}, 0)), {0, 0, 1, 4},
      {{"proxy", std::string("mesh")}, {"mesh", std::string("patch.obj")}});
  std::set<int> depths;
  for (const float z : pair.fast.z) {
    if (std::isfinite(z)) depths.insert(static_cast<int>(std::lround(z * 100)));
  }
  EXPECT_EQ(depths, (std::set{300, 400}));
}

TEST_F(Lumigraph, AMeshThatIsNotThereIsRefused) {
  const store::Take take = write(grid_take(2, 2));
  const VirtualCamera view = virtual_camera_with_fov(9, 9, 1, {});
  EXPECT_THROW(render_both(take, view, {0, 0, 1, 4}, {{"proxy", std::string("mesh")}}), Error);
  EXPECT_THROW(render_both(take, view, {0, 0, 1, 4},
                           {{"proxy", std::string("mesh")}, {"mesh", std::string("no.obj")}}),
               Error);
  write_file_atomically(take.folder() / "points.obj", "v 0 0 -4\nv 1 0 -4\n");
  EXPECT_THROW(render_both(take, view, {0, 0, 1, 4},
                           {{"proxy", std::string("mesh")}, {"mesh", std::string("points.obj")}}),
               Error);
}

TEST_F(Lumigraph, TheBlendingFieldComesClose) {
  const store::Take take = write(grid_take(5, 5));
  const VirtualCamera view =
      virtual_camera_with_fov(320, 240, 40 * kDegree, make_pose({0.01, 0.02, 0.3}, 1));
  const Eigen::Vector4d ghosting(0, 0, 1, 3.5);
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const LightFieldRenderer renderer(take, {});
  const RenderedView pixels = renderer.render(view, frames, {"lumigraph", ghosting});
  const RenderedView field = renderer.render(
      view, frames, {"lumigraph", ghosting, {{"weights", std::string("blending_field")}}});
  double squares = 0;
  for (std::size_t i = 0; i < pixels.rgba.size(); ++i) {
    const double by = static_cast<double>(pixels.rgba[i] - field.rgba[i]);
    squares += by * by;
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(pixels.rgba.size())), 0.01);
  EXPECT_NE(pixels.rgba, field.rgba);
  EXPECT_EQ(pixels.z, field.z);
}

TEST_F(Lumigraph, DegenerateArraysRender) {
  for (const auto& [rows, columns] : {std::pair{1, 4}, {4, 1}, {1, 1}, {1, 2}}) {
    SCOPED_TRACE(std::to_string(rows) + "x" + std::to_string(columns));
    const auto folder = folder_.path() / (std::to_string(rows) + std::to_string(columns));
    write_synthetic_take(grid_take(rows, columns), folder);
    const FastAndReference pair = render_both(
        store::Take(folder),
        virtual_camera_with_fov(80, 60, 40 * kDegree, make_pose({0.005, 0.002, 0.01}, 0)),
        {0, 0, 1, 4});
    expect_equal(pair);
    EXPECT_GT(mean_alpha(pair.fast), 0.9);
  }
}

TEST_F(Lumigraph, AnAbsentCamerasNeighboursStandInAndCoverageSaysSo) {
  SyntheticTake settings = grid_take(3, 3);
  settings.frames = 2;
  settings.absent = {{4, 1}};  // the middle camera, second frame
  const store::Take take = write(settings);
  const VirtualCamera view =
      virtual_camera_with_fov(90, 90, 20 * kDegree, make_pose({0, 0, 0.2}, 0));
  const FastAndReference whole = render_both(take, view, {0, 0, 1, 4}, {}, 0);
  const FastAndReference lacking = render_both(take, view, {0, 0, 1, 4}, {}, 1);
  expect_equal(whole);
  expect_equal(lacking);
  const std::size_t middle = 45 * 90 + 45;
  EXPECT_NEAR(whole.fast.coverage[middle], 1, 1e-5);
  EXPECT_NEAR(lacking.fast.rgba[middle * 4 + 3], 1, 1e-5);
  EXPECT_LT(lacking.fast.coverage[middle], 0.1);
}

TEST_F(Lumigraph, SameBytesForAnyNumberOfThreads) {
  const store::Take take = write(grid_take(4, 4, {-0.2, 0, 0, 0, 0}));
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const VirtualCamera view = virtual_camera_with_fov(160, 120, 0.8, make_pose({0, 0.01, 0.1}, 2));
  for (const std::string weights : {"per_pixel", "blending_field"}) {
    std::vector<RenderedView> images;
    for (const std::size_t threads : {1, 2, 5}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      images.push_back(LightFieldRenderer(take, {}).render(
          view, frames, {"lumigraph", {0, 0, 1, 4}, {{"weights", weights}}}));
    }
    EXPECT_EQ(images[0].rgba, images[1].rgba);
    EXPECT_EQ(images[0].rgba, images[2].rgba);
    EXPECT_EQ(images[0].z, images[2].z);
  }
}

TEST_F(Lumigraph, DecodesLittleMoreThanItNeeds) {
  SyntheticTake settings;
  settings.cameras = testing::camera_grid(3, 3, 0.06, 960, 720);
  settings.jpeg = {90, store::JpegEncodeOptions::Chroma::k420, -1};
  const store::Take take = write(settings);
  const store::FrameSelection frames = store::select_frames(take, 0, 1);
  const VirtualCamera view =
      virtual_camera_with_fov(720, 540, 40 * kDegree, make_pose({0, 0, 0.2}, 0));
  RendererOptions settings_of_renderer;
  const ReconstructionOptions reconstruction{"lumigraph", {0, 0, 1, 4}};
  const RenderedView image =
      LightFieldRenderer(take, settings_of_renderer).render(view, frames, reconstruction);
  settings_of_renderer.count_needed_pixels = true;
  const RenderStatistics counted = LightFieldRenderer(take, settings_of_renderer)
                                       .render(view, frames, reconstruction)
                                       .statistics;
  ASSERT_GT(counted.pixels_needed, 0);
  EXPECT_LT(static_cast<double>(image.statistics.pixels_decoded) /
                static_cast<double>(counted.pixels_needed),
            1.3);
  EXPECT_GE(image.statistics.pixels_decoded, counted.pixels_needed);
  EXPECT_GE(image.statistics.working_bytes, 8U * 720 * 540);  // the ends of all rays
  EXPECT_LT(image.statistics.working_bytes, 9U * 720 * 540);
  settings_of_renderer.count_needed_pixels = false;
  settings_of_renderer.cache_bytes = 1;
  EXPECT_EQ(
      LightFieldRenderer(take, settings_of_renderer).render(view, frames, reconstruction).rgba,
      image.rgba);
}

}  // namespace
}  // namespace raystage::render
