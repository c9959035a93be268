// SPDX-License-Identifier: Apache-2.0
// Compares the estimated uncertainties with the errors of many simulated recordings of one array.
#include "calibrate/geometry/uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calibrate/geometry/calibration.h"
#include "testing/calibrate/test_synthetic_array.h"

namespace raystage::calibrate {
namespace {

/// Sums of squares of the errors (`wrong`) and of the estimated deviations (`said`).
struct Squares {
  double wrong = 0, said = 0;
  double ratio() const { return std::sqrt(wrong / said); }
};

TEST(Deviations, AreAsLargeAsErrors) {
  Squares places, focal_lengths;
  constexpr int kRecordings = 14;
  for (int i = 0; i < kRecordings; ++i) {
    const testing::SyntheticArray truth =
        testing::make_synthetic_array({.rows = 2,
                                       .columns = 3,
                                       .mounting_deg = 12,
                                       .outliers = 0,
                                       .seed = static_cast<unsigned>(100 + i)});
    CalibrationOptions options;
    options.solve.horizontal_fov = 60 * testing::kTestDegree;
    Calibration found = calibrate(truth.detections, options);
    ASSERT_TRUE(found.uncertainty);
    std::vector<rig::Pose> poses;
    for (const ArrayModel::Camera& camera : found.model.cameras) poses.push_back(*camera.pose);
    const SimilarityTransform back = estimate_similarity(poses, truth.poses);
    for (std::size_t k = 0; k < poses.size(); ++k) {
      const Uncertainty::Camera& said = *found.uncertainty->cameras[k];
      places.wrong += (back(poses[k]).position - truth.poses[k].position).squaredNorm();
      places.said += (back.scale * said.position).squaredNorm();
    }
    const double off = found.model.cameras[0].intrinsics.fx - truth.lens.fx;
    focal_lengths.wrong += off * off;
    focal_lengths.said += std::pow(found.uncertainty->cameras[0]->lens[0], 2);
    EXPECT_NEAR(found.uncertainty->noise_px, 0.2, 0.04);
  }
  EXPECT_GE(places.ratio(), 0.7);
  EXPECT_LE(places.ratio(), 1.4);
  EXPECT_GE(focal_lengths.ratio(), 0.6);
  EXPECT_LE(focal_lengths.ratio(), 1.5);
}

/// Slow reference: a numerical Jacobian over all parameters (poses except the first two, one lens,
/// points).
class Moved {
 public:
  explicit Moved(ArrayModel model) : model_(std::move(model)) {
    for (std::size_t p = 0; p < model_.points.size(); ++p) {
      if (model_.points[p]) points_.push_back(p);
    }
  }
  /// Returns the number of parameters. There are 6 per camera from the third on (rotation in the
  /// camera, position), 5 of the lens (focal length, principal point, k1, k2), and 3 per point.
  Eigen::Index size() const {
    return first_point() + 3 * static_cast<Eigen::Index>(points_.size());
  }
  Eigen::Index pose(std::size_t camera) const {
    return 6 * (static_cast<Eigen::Index>(camera) - 2);
  }
  Eigen::Index lens() const { return pose(model_.cameras.size()); }

  Eigen::MatrixXd jacobian() const {
    Eigen::MatrixXd result;
    for (Eigen::Index k = 0; k < size(); ++k) {
      const double step = k >= lens() && k < lens() + 3 ? 1e-3 : 1e-6;
      const Eigen::VectorXd change = (residuals(k, step) - residuals(k, -step)) / (2 * step);
      if (k == 0) result.resize(change.size(), size());
      result.col(k) = change;
    }
    return result;
  }

 private:
  Eigen::Index first_point() const { return lens() + 5; }

  Eigen::VectorXd residuals(Eigen::Index unknown, double by) const {
    ArrayModel model = model_;
    if (unknown < lens()) {
      rig::Pose& pose = *model.cameras[static_cast<std::size_t>(unknown / 6) + 2].pose;
      const Eigen::Index value = unknown % 6;
      if (value < 3) {
        pose.world_from_camera_rotation *=
            Eigen::AngleAxisd(by, Eigen::Vector3d::Unit(value)).toRotationMatrix();
      } else {
        pose.position[value - 3] += by;
      }
    } else if (unknown < first_point()) {
      for (ArrayModel::Camera& camera : model.cameras) {
        schemas::Intrinsics& k = camera.intrinsics;
        double* const values[] = {&k.fx, &k.cx, &k.cy, &k.distortion.k1, &k.distortion.k2};
        *values[unknown - lens()] += by;
        k.fy = k.fx;
      }
    } else {
      const Eigen::Index at = unknown - first_point();
      (*model.points[points_[at / 3]])[at % 3] += by;
    }
    const CameraModels lenses = camera_models(model);
    std::vector<double> all;
    for (const ArrayModel::Observation& o : model.observations) {
      if (!model.counts(o)) continue;
      const Eigen::Vector2d off = *reprojection_residual(model, lenses, o);
      all.insert(all.end(), {off.x(), off.y()});
    }
    return Eigen::Map<Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size()));
  }

  ArrayModel model_;
  std::vector<std::size_t> points_;
};

TEST(Deviations, AreThoseOfTheWholeCovariance) {
  const testing::SyntheticArray truth = testing::make_synthetic_array(
      {.rows = 2, .columns = 2, .mounting_deg = 8, .points = 40, .outliers = 0, .missing = 0.1});
  CalibrationOptions options;
  options.solve.horizontal_fov = 60 * testing::kTestDegree;
  const Calibration found = calibrate(truth.detections, options);
  BundleAdjustmentOptions free = found.solve.last;
  ASSERT_EQ(free.lens, LensRefinement::kRadial);
  free.fixed_cameras = {true, true, false, false};
  const auto said = estimate_uncertainty(found.model, free, {});
  ASSERT_TRUE(said);
  const Moved moved(found.model);
  const Eigen::MatrixXd jacobian = moved.jacobian();
  const double variance =
      said->noise_px * said->noise_px * (1 + said->correlation) / (1 - said->correlation);
  const Eigen::VectorXd deviations =
      (variance * (jacobian.transpose() * jacobian).inverse()).diagonal().cwiseSqrt();
  const auto expect = [](double said_is, double is) { EXPECT_NEAR(said_is, is, 0.01 * is); };
  for (const std::size_t camera : {2U, 3U}) {
    const Eigen::Index at = moved.pose(camera);
    for (Eigen::Index k = 0; k < 3; ++k) {
      expect(said->cameras[camera]->rotation_deg[k], deviations[at + k] / testing::kTestDegree);
      expect(said->cameras[camera]->position[k], deviations[at + 3 + k]);
    }
  }
  constexpr std::size_t kFreed[] = {0, 2, 3, 4, 5};
  for (Eigen::Index k = 0; k < 5; ++k) {
    expect(said->cameras[0]->lens[kFreed[k]], deviations[moved.lens() + k]);
  }
}

TEST(Lenses, ThatRestStayEachAsItIs) {
  const testing::SyntheticArray truth = testing::make_synthetic_array({.rows = 2, .columns = 2});
  CalibrationOptions options;
  options.solve.lenses.assign(4, truth.lens);
  options.solve.lenses[1].fx = options.solve.lenses[1].fy = 1.02 * truth.lens.fx;
  options.solve.lens_is_known = true;
  const Calibration found = calibrate(truth.detections, options);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(found.model.cameras[i].intrinsics, options.solve.lenses[i]) << i;
  }
}

TEST(Deviations, OfHeldPartsAreNone) {
  const testing::SyntheticArray truth = testing::make_synthetic_array({.rows = 2, .columns = 2});
  CalibrationOptions options;
  options.solve.lenses.assign(4, truth.lens);
  options.solve.lens_is_known = true;
  const Calibration found = calibrate(truth.detections, options);
  BundleAdjustmentOptions free = found.solve.last;
  const auto all = estimate_uncertainty(found.model, free, {});
  ASSERT_TRUE(all);
  EXPECT_EQ(all->cameras[0]->lens, LensParameters{});
  free.fixed_cameras = {true, true, false, false};
  const auto some = estimate_uncertainty(found.model, free, {});
  ASSERT_TRUE(some);
  EXPECT_FALSE(some->cameras[0]);
  EXPECT_GT(some->cameras[2]->position.norm(), 0);
  free.fixed_cameras.assign(4, true);
  EXPECT_FALSE(estimate_uncertainty(found.model, free, {}));
}

TEST(Deviations, OfWhatNothingTellsAreHuge) {
  // Cameras with parallel axes cannot distinguish a longer lens from a deeper scene.
  const testing::SyntheticArray truth =
      testing::make_synthetic_array({.rows = 2, .columns = 3, .mounting_m = 0, .mounting_deg = 0});
  CalibrationOptions options;
  options.solve.horizontal_fov = 60 * testing::kTestDegree;
  const Calibration found = calibrate(truth.detections, options);
  ASSERT_TRUE(found.uncertainty);
  const Uncertainty::Direction& worst = found.uncertainty->weakest.front();
  EXPECT_GT(worst.deviation, 10);
  EXPECT_GT(worst.focal_length, 0.3);
}

}  // namespace
}  // namespace raystage::calibrate
