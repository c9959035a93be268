// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color/scene_patches.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <filesystem>
#include <limits>

#include "base/error.h"
#include "simulate/simulate.h"
#include "testing/test_folder.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Returns a take of a scene by six cameras with the same colours.
store::Take simulated(const std::string& scene, const testing::TestFolder& folder) {
  simulate::SimulationOptions options;
  options.scene = scene;
  options.rows = 2;
  options.columns = 3;
  options.seconds = 0.3;
  options.fps = 10;
  options.startup_loss_s = 0;
  options.drop_probability = 0;
  options.noise = 0.002;
  options.jpeg.quality = 95;
  options.truth_views = 0;
  simulate::simulate(options, folder.path() / scene, "test");
  return store::Take(folder.path() / scene);
}

std::vector<ScenePatch> found_in(const store::Take& take, const PatchSearchOptions& options) {
  return find_scene_patches(take, take.rig(), options, [](double) {}, {});
}

/// Returns the depth of the point at which the rays of the first two observations are closest,
/// metres in front of the array.
double depth_of(const ScenePatch& point, const rig::Rig& rig) {
  Eigen::Matrix<double, 3, 2> directions;
  Vector3d places[2];
  for (std::size_t i = 0; i < 2; ++i) {
    const ScenePatch::Observation& observation = point.observations[i];
    const rig::Rig::Camera& camera = rig.cameras[observation.camera];
    directions.col(static_cast<Eigen::Index>(i)) =
        camera.pose.world_from_camera_rotation *
        *camera.model.unproject({observation.x, observation.y});
    places[i] = camera.pose.position;
  }
  directions.col(1) *= -1;
  const Vector2d along = directions.colPivHouseholderQr().solve(places[1] - places[0]);
  const Vector3d x = places[0] + along[0] * directions.col(0);
  return rig.mean_viewing_direction().dot(x - rig.centre());
}

TEST(SurfacePoints, AreTheSamePlacesInAllCameras) {
  const testing::TestFolder folder;
  const store::Take take = simulated("stage", folder);
  PatchSearchOptions options;
  options.instants = 1;
  options.depths = *take.document().depth_range;
  const std::vector<ScenePatch> points = found_in(take, options);
  ASSERT_GT(points.size(), 500U);
  int observations = 0, wrong = 0, out_of_depth = 0;
  for (const ScenePatch& point : points) {
    ASSERT_GE(point.observations.size(), 2U);
    const double depth = depth_of(point, take.rig());
    out_of_depth += depth < options.depths.near * 0.9 || depth > options.depths.far * 1.2 ? 1 : 0;
    for (const ScenePatch::Observation& observation : point.observations) {
      bool is_alike = true;
      for (std::size_t c = 0; c < 3; ++c) {
        const double expected = point.observations[0].measured[c];
        is_alike =
            is_alike && std::abs(observation.measured[c] - expected) < 0.003 + 0.04 * expected;
      }
      wrong += is_alike ? 0 : 1;
      ++observations;
    }
  }
  EXPECT_LE(out_of_depth, static_cast<int>(points.size()) / 50);
  EXPECT_LE(wrong, observations / 10);

  options.max_points = 100;
  EXPECT_EQ(found_in(take, options).size(), 100U);
}

TEST(SurfacePoints, OnAFocalPlaneLieThere) {
  const testing::TestFolder folder;
  const store::Take take = simulated("chart", folder);
  PatchSearchOptions options;
  options.instants = 1;
  options.depths = {3.9, 4.1};  // the chart; balls are in front of it
  const std::vector<ScenePatch> points = found_in(take, options);
  ASSERT_GT(points.size(), 100U);
  for (const ScenePatch& point : points) EXPECT_NEAR(depth_of(point, take.rig()), 4, 0.8);
  // A single depth is accepted as a range, and so is an infinite far limit.
  options.depths = {4, 4};
  EXPECT_GT(found_in(take, options).size(), points.size() / 2);
  options.depths = {2, std::numeric_limits<double>::infinity()};
  EXPECT_GT(found_in(take, options).size(), points.size() / 2);
  options.depths = {0.4, 0.5};
  EXPECT_LT(found_in(take, options).size(), points.size() / 10);
}

TEST(SurfacePoints, AreNotFoundWhereNothingHasAPattern) {
  const testing::TestFolder folder;
  const store::Take take = simulated("grey", folder);
  PatchSearchOptions options;
  options.depths = {1, 10};
  EXPECT_TRUE(found_in(take, options).empty());
  // A rig with another frame size is rejected before the search.
  rig::Rig rig = take.rig();
  rig.cameras[2].model = rig::CameraModel({"c", 100, 80, {90, 90, 50, 40, {}}, {}, {}, {}});
  EXPECT_THROW(find_scene_patches(take, rig, options, [](double) {}, {}), Error);
}

}  // namespace
}  // namespace raystage::calibrate
