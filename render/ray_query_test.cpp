// SPDX-License-Identifier: Apache-2.0
#include "render/lumigraph/ray_query.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "base/atomic_file.h"
#include "base/error.h"
#include "render/common/ray_cells.h"
#include "render/renderer.h"
#include "render/sampling/source_view.h"
#include "testing/render/synthetic_take.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::SyntheticTake;

class RayQuery : public ::testing::Test {
 protected:
  store::Take write(std::vector<std::pair<int, int>> absent = {}) {
    SyntheticTake options;
    options.cameras = testing::camera_grid(4, 4, 0.06, 160, 120, {-0.15, 0.02, 0, 0, 0});
    options.absent = std::move(absent);
    write_synthetic_take(options, folder_.path() / "take");
    return store::Take(folder_.path() / "take");
  }
  static std::vector<RaySample> ask(const store::Take& take, const std::vector<WorldRay>& rays,
                                    const ReconstructionOptions& reconstruction,
                                    bool reference = false) {
    RendererOptions options;
    options.reference = reference;
    std::vector<RaySample> samples(rays.size());
    LightFieldRenderer(take, options)
        .query(rays, store::select_frames(take, 0, 1), reconstruction, samples);
    return samples;
  }
  testing::TestFolder folder_;
};

/// Returns rays from all sides, most of them towards the scene.
std::vector<WorldRay> some_rays(int count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(-1, 1);
  std::vector<WorldRay> rays;
  for (int i = 0; i < count; ++i) {
    const Vector3d origin(any(random), any(random), any(random));
    const Vector3d target(any(random), any(random), -4);
    rays.push_back({origin * (i % 3 == 0 ? 5 : 0.2), target - origin});  // any length
  }
  return rays;
}

void expect_equal(const std::vector<RaySample>& fast, const std::vector<RaySample>& reference) {
  int seen = 0;
  for (std::size_t i = 0; i < fast.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_NEAR(fast[i].rgba[c], reference[i].rgba[c], 2e-3) << "ray " << i;
    }
    ASSERT_NEAR(fast[i].coverage, reference[i].coverage, 2e-3) << "ray " << i;
    if (reference[i].coverage < 0.999F) continue;
    ++seen;
    ASSERT_NEAR(fast[i].depth / reference[i].depth, 1, 1e-5) << "ray " << i;
    ASSERT_NEAR(fast[i].cameras, reference[i].cameras, 0.02) << "ray " << i;
    ASSERT_NEAR(fast[i].nearest_ray, reference[i].nearest_ray, 1e-5) << "ray " << i;
  }
  EXPECT_GT(seen, static_cast<int>(fast.size()) / 4);
}

TEST_F(RayQuery, AgreesWithTheReference) {
  const store::Take take = write();
  write_file_atomically(take.folder() / "wall.obj",
                        "v -9 -9 -4\nv 9 -9 -4\nv 9 9 -4\nv -9 9 -4\nf 1 2 3 4\n");
  const std::vector<WorldRay> rays = some_rays(3000);
  for (const ReconstructionOptions& reconstruction :
       {ReconstructionOptions{"lumigraph", {0, 0, 1, 4}},
        ReconstructionOptions{"focal_plane", {0, 0.1, 1, 3}},
        ReconstructionOptions{"lumigraph",
                              {0, 0, 1, 9},
                              {{"proxy", std::string("mesh")},
                               {"mesh", std::string("wall.obj")},
                               {"cameras", 2.0}}}}) {
    expect_equal(ask(take, rays, reconstruction), ask(take, rays, reconstruction, true));
  }
}

TEST_F(RayQuery, AgreesWithTheReferenceOnEveryInstructionSet) {
  const store::Take take = write();
  const std::vector<WorldRay> rays = some_rays(500);
  const ReconstructionOptions reconstruction{"lumigraph", {0, 0, 1, 4}};
  const std::vector<RaySample> reference = ask(take, rays, reconstruction, true);
  testing::for_each_simd_target(kernel_target,
                                [&] { expect_equal(ask(take, rays, reconstruction), reference); });
}

TEST_F(RayQuery, AnswersAViewsRaysAsTheViewIsRendered) {
  const store::Take take = write();
  VirtualCamera view = virtual_camera_with_fov(90, 70, 0.7, {});
  view.pose.position = {0.013, -0.02, 0.1};
  const ReconstructionOptions reconstruction{"lumigraph", {0.1, 0, 1, 3.5}};
  const RenderedView image =
      LightFieldRenderer(take, {}).render(view, store::select_frames(take, 0, 1), reconstruction);
  std::vector<WorldRay> rays;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      rays.push_back(
          {view.pose.position, world_ray_from_pixel(view) * Vector3d(x + 0.5, y + 0.5, 1)});
    }
  }
  const std::vector<RaySample> samples = ask(take, rays, reconstruction);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_NEAR(samples[i].rgba[c], image.rgba[4 * i + c], 1e-3) << i;
    }
    ASSERT_NEAR(samples[i].coverage, image.coverage[i], 1e-3) << i;
    if (!(samples[i].coverage > 0)) continue;
    const double cosine = rays[i].direction.normalized().dot(view.pose.viewing_direction());
    ASSERT_NEAR(samples[i].depth * cosine, double{image.z[i]}, 1e-4) << i;
  }
}

TEST_F(RayQuery, ARayThroughACameraIsItsOwnAndSaysHowNear) {
  const store::Take take = write();
  const Vector3d centre = take.rig().cameras[5].pose.position;
  const Vector3d direction = Vector3d(0.1, 0.05, -1).normalized();
  const auto samples = ask(take,
                           {{centre - 0.5 * direction, direction},
                            {centre - direction + Vector3d(0.01, 0, 0), direction}},
                           {"lumigraph", {0, 0, 1, 4}});
  EXPECT_NEAR(samples[0].cameras, 1, 0.01);
  EXPECT_NEAR(samples[0].nearest_ray, 0, 1e-6);
  EXPECT_GT(samples[1].cameras, 1.02);
  EXPECT_NEAR(samples[1].nearest_ray, Vector3d(0.01, 0, 0).cross(direction).norm(), 1e-6);
  const Vector3d hit = centre + direction * (4 / -direction.z());
  const auto truth = testing::painted_plane(hit.x(), hit.y());
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(samples[0].rgba[c], truth[c], 0.03);
}

TEST_F(RayQuery, WhatIsNoRayOrSeesNothingIsTransparent) {
  const store::Take take = write({{5, 0}});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const auto samples = ask(take,
                           {{{0, 0, 0}, {0, 0, 0}},
                            {{nan, 0, 0}, {0, 0, -1}},
                            {{0, 0, 0}, {0, infinity, -1}},
                            {{0, 0, 0}, {0, 0, 1}},     // away from the plane
                            {{50, 0, -3}, {0, 0, -1}},  // where no camera looks
                            {{-0.03, 0.03, 0}, {0, 0, -1e-200}}},
                           {"lumigraph", {0, 0, 1, 4}});
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(samples[i].rgba, (std::array<float, 4>{})) << i;
    EXPECT_EQ(samples[i].coverage, 0) << i;
    EXPECT_EQ(samples[i].depth, static_cast<float>(infinity)) << i;
  }
  EXPECT_NEAR(samples[5].rgba[3], 1, 1e-5);
  EXPECT_LT(samples[5].coverage, 0.1);  // its camera is absent
  EXPECT_TRUE(ask(take, {}, {"lumigraph", {0, 0, 1, 4}}).empty());
}

TEST_F(RayQuery, MethodsThatChooseForViewsRefuseRaysAndSayWhy) {
  const store::Take take = write();
  const auto refused = [&](const ReconstructionOptions& reconstruction) -> std::string {
    try {
      ask(take, {{{0, 0, 0}, {0, 0, -1}}}, reconstruction);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refused({"auto", {0, 0, 1, 4}}), HasSubstr("auto can only choose for views"));
  EXPECT_THAT(refused({"slabs", {0, 0, 1, 4}, {{"layout", std::string("box")}}}),
              HasSubstr("a plane per face"));
  EXPECT_EQ(refused({"slabs", {0, 0, 1, 4}}), "");
}

TEST_F(RayQuery, SlabsAreAnsweredOnTheFocalPlane) {
  const store::Take take = write();
  const std::vector<WorldRay> rays = some_rays(300);
  const std::vector<RaySample> slabs = ask(take, rays, {"slabs", {0, 0.1, 1, 3}});
  const std::vector<RaySample> plane = ask(take, rays, {"lumigraph", {0, 0.1, 1, 3}});
  for (std::size_t i = 0; i < rays.size(); ++i) {
    ASSERT_EQ(slabs[i].rgba, plane[i].rgba);
    ASSERT_EQ(slabs[i].depth, plane[i].depth);
  }
}

TEST_F(RayQuery, SameBytesForAnyNumberOfThreads) {
  const store::Take take = write();
  const std::vector<WorldRay> rays = some_rays(5000);
  std::vector<std::vector<RaySample>> answers;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    answers.push_back(ask(take, rays, {"lumigraph", {0, 0, 1, 4}}));
  }
  for (std::size_t i = 0; i < rays.size(); ++i) {
    ASSERT_EQ(answers[0][i].rgba, answers[1][i].rgba);
    ASSERT_EQ(answers[0][i].rgba, answers[2][i].rgba);
    ASSERT_EQ(answers[0][i].nearest_ray, answers[2][i].nearest_ray);
  }
}

}  // namespace
}  // namespace raystage::render
