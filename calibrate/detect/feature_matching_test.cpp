// SPDX-License-Identifier: Apache-2.0
// Tests feature matching with a captured scene whose camera poses were surveyed.
#include "calibrate/detect/feature_matching.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

#include "base/error.h"
#include "calibrate/geometry/calibration.h"
#include "calibrate/geometry/rig_comparison.h"
#include "ingest/import_take.h"
#include "testing/test_data.h"
#include "testing/test_folder.h"

namespace raystage::calibrate {
namespace {

/// Returns the rig with every camera moved by 5 cm and rotated by half a degree.
schemas::RigDocument disturbed(schemas::RigDocument rig) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto somewhere = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  for (schemas::RigDocument::Camera& camera : rig.cameras) {
    rig::Pose pose = rig::pose_from_matrix(camera.geometry.world_from_camera);
    pose.position += 0.05 * somewhere();
    pose.world_from_camera_rotation =
        pose.world_from_camera_rotation *
        Eigen::AngleAxisd(0.5 * std::numbers::pi / 180, somewhere()).toRotationMatrix();
    camera.geometry.world_from_camera = rig::matrix_from_pose(pose);
  }
  return rig;
}

TEST(SceneFeatures, BringSurveyedCamerasBack) {
  const auto manifest = testing::test_data() / "fountain-P11" / "import.json";
  if (!std::filesystem::exists(manifest)) GTEST_SKIP() << "no surveyed scene at " << manifest;
  const testing::TestFolder folder;
  ingest::import_take(schemas::read_import_manifest(manifest), manifest.parent_path(),
                      folder.path() / "take", {});
  const schemas::RigDocument survey = schemas::read_rig(folder.path() / "take" / "rig.json");
  FeatureMatchingOptions features;
  features.max_features = 1500;
  CalibrationOptions options;
  options.start = disturbed(survey);
  options.solve.lens_is_known = true;
  const store::Take take(folder.path() / "take");
  const Calibration found = calibrate(
      match_features(take, 0, kNanosecondsPerSecond, features, [](double) {}, {}), options);
  EXPECT_TRUE(found.verdict.is_accepted()) << ::testing::PrintToString(found.verdict.reasons);
  const RigComparison before = compare_rigs(survey, *options.start, 0),
                      after = compare_rigs(survey, make_rig_document(found, options.start, ""), 0);
  double moved = 0, left = 0;
  for (std::size_t i = 0; i < after.cameras.size(); ++i) {
    moved = std::max(moved, before.cameras[i].position_m);
    left = std::max(left, after.cameras[i].position_m);
    EXPECT_LE(after.cameras[i].rotation_deg, 0.15) << after.cameras[i].id;
  }
  SCOPED_TRACE(fmt::format("{:.1f} mm before, {:.1f} after", 1000 * moved, 1000 * left));
  EXPECT_GT(moved, 0.04);
  EXPECT_LE(left, 0.01);
  EXPECT_THROW(match_features(take, 50 * kNanosecondsPerSecond, 1, features, [](double) {}, {}),
               Error);
}

}  // namespace
}  // namespace raystage::calibrate
