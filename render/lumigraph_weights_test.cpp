// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>

#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"
#include "render/lumigraph/camera_selection.h"
#include "render/lumigraph/ray_chunk.h"
#include "render/lumigraph/ray_directions.h"
#include "render/lumigraph/ray_weights.h"
#include "render/sampling/source_view.h"
#include "testing/render/extremes.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::kDegree;
using testing::make_pose;
using testing::SyntheticTake;

rig::Rig grid_rig(int rows, int columns, const schemas::Distortion& distortion = {}) {
  schemas::RigDocument document;
  for (const schemas::CameraGeometry& camera :
       testing::camera_grid(rows, columns, 0.06, 160, 120, distortion)) {
    document.cameras.push_back({camera, {}});
  }
  return rig::rig_from_document(document);
}

std::vector<int> all_cameras(const rig::Rig& rig) {
  std::vector<int> all;
  for (int i = 0; i < static_cast<int>(rig.cameras.size()); ++i) all.push_back(i);
  return all;
}

/// Calls on_ray(weights of all cameras, index in them) with the weights of the kernels for each
/// ray.
template <class OnRay>
void weigh_rays(const rig::Rig& rig, const std::vector<WorldRay>& rays,
                const std::vector<double>& inverse_distance, const RayWeightOptions& weighing,
                const OnRay& on_ray) {
  const std::vector<ChunkCamera> cameras = chunk_cameras(rig);
  std::vector<const ChunkCamera*> pointers;
  for (const ChunkCamera& camera : cameras) pointers.push_back(&camera);
  std::vector<ChunkWeights> weights(cameras.size());
  RayChunk chunk;
  for (std::size_t begin = 0; begin < rays.size(); begin += RayChunk::kSize) {
    const std::size_t n = std::min<std::size_t>(RayChunk::kSize, rays.size() - begin);
    fill_chunk(std::span(rays).subspan(begin, n), std::span(inverse_distance).subspan(begin, n),
               rig.centre(), chunk);
    compute_camera_weights(chunk, pointers,
                           ChunkWeightOptions(weighing, mean_nearest_baseline(rig)), weights);
    for (std::size_t i = 0; i < n; ++i) on_ray(weights, i);
  }
}

/// Returns the weights of the kernels by ray and camera, as the reference returns them.
std::vector<std::vector<double>> weights_of(const rig::Rig& rig, const std::vector<WorldRay>& rays,
                                            const std::vector<double>& inverse_distance,
                                            const RayWeightOptions& weighing) {
  std::vector<std::vector<double>> result;
  weigh_rays(rig, rays, inverse_distance, weighing,
             [&](const std::vector<ChunkWeights>& weights, std::size_t i) {
               result.emplace_back();
               for (const ChunkWeights& camera : weights) {
                 result.back().push_back(static_cast<double>(camera.weight[i]));
               }
             });
  return result;
}

std::vector<double> reference_weights(const rig::Rig& rig, const WorldRay& ray,
                                      double inverse_distance, const RayWeightOptions& weighing) {
  std::vector<double> weights(rig.cameras.size());
  double seen = 0;
  const auto found = compute_camera_weights_reference(rig, all_cameras(rig), ray, inverse_distance,
                                                      weighing, mean_nearest_baseline(rig));
  for (const WeightedCamera& camera : found) seen = std::max(seen, camera.seen);
  for (const WeightedCamera& camera : found) {
    weights[camera.camera] = camera.weight * seen;
  }
  return weights;
}

void expect_weights_agree(const rig::Rig& rig, const std::vector<WorldRay>& rays,
                          const std::vector<double>& inverse_distance,
                          const RayWeightOptions& weighing) {
  const auto fast = weights_of(rig, rays, inverse_distance, weighing);
  int seen = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto reference = reference_weights(rig, rays[i], inverse_distance[i], weighing);
    for (std::size_t c = 0; c < reference.size(); ++c) {
      ASSERT_NEAR(fast[i][c], reference[c], 2e-3) << "ray " << i << ", camera " << c;
      seen += reference[c] > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(seen, 0);
}

struct SomeRays {
  std::vector<WorldRay> rays;
  std::vector<double> inverse_distance;
};

SomeRays rays_from(const Vector3d& eye, double spread, std::pair<double, double> distance) {
  SomeRays some;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int i = 0; i < 150; ++i) {
    const Vector3d direction =
        (Vector3d(0, 0, -6) - eye + spread * Vector3d(any(random), any(random), 0)).normalized();
    some.rays.push_back({eye, direction});
    const double d = distance.first + (distance.second - distance.first) * (any(random) + 1) / 2;
    some.inverse_distance.push_back(i % 10 == 0 ? 0 : 1 / d);
  }
  some.inverse_distance[3] = std::numeric_limits<double>::quiet_NaN();
  return some;
}

TEST(LumigraphWeights, AgreeWithTheReferenceOnEveryInstructionSet) {
  const rig::Rig rig = grid_rig(5, 6, {-0.2, 0.05, 0.001, -0.002, 0.003});
  testing::for_each_simd_target(kernel_target, [&] {
    for (const int k : {1, 4, 16}) {
      RayWeightOptions weighing;
      weighing.cameras = k;
      for (const auto& [eye, spread, near, far] :
           {std::tuple{Vector3d(0.01, 0.02, 0), 2.0, 3.0, 9.0},
            {Vector3d(0.03, -0.02, 0.8), 3.0, 2.0, 30.0},
            {Vector3d(0.02, 0.01, -1.5), 1.5, 0.5, 4.0},
            {Vector3d(0.5, 0.5, 60), 1.0, 62.0, 66.0}}) {
        SCOPED_TRACE(eye.transpose());
        const SomeRays some = rays_from(eye, spread, {near, far});
        expect_weights_agree(rig, some.rays, some.inverse_distance, weighing);
      }
    }
  });
}

TEST(LumigraphRays, OfAViewAreThoseOfItsPixelsOnEveryInstructionSet) {
  const Vector3d eye(12.3, -4.5, 60.7), middle(12, -4, 60);
  VirtualCamera view = virtual_camera_with_fov(300, 200, 1.2, {});
  view.pose.position = eye;
  view.pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
  testing::for_each_simd_target(kernel_target, [&] {
    for (const int count : {1, 7, 61, RayChunk::kSize}) {
      RayDirections row;
      compute_ray_directions(ray_from_pixel, 200, 17, count, row);
      std::vector<WorldRay> rays;
      std::vector<double> inverse;
      for (int i = 0; i < count; ++i) {
        rays.push_back({eye, (ray_from_pixel * Vector3d(200.5 + i, 17.5, 1)).normalized()});
        inverse.push_back(0.1 * i);
        ASSERT_NEAR((row[i] - rays.back().direction).norm(), 0, 1e-15);
      }
      RayChunk of_rays, of_row;
      fill_chunk(rays, inverse, middle, of_rays);
      fill_chunk(eye, row, inverse, middle, of_row);
      ASSERT_EQ(of_row.count, count);
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          ASSERT_NEAR(of_row.base[axis][i], of_rays.base[axis][i], 1e-7);
          ASSERT_NEAR(of_row.direction[axis][i], of_rays.direction[axis][i], 1e-7);
        }
        ASSERT_NEAR(of_row.eye[i], of_rays.eye[i], 1e-7);
        ASSERT_NEAR(of_row.point[i] / of_rays.point[i], 1, 1e-6);
        ASSERT_EQ(of_row.inverse_distance[i], of_rays.inverse_distance[i]);
      }
      for (std::size_t i = static_cast<std::size_t>(count); i < RayChunk::kSize; ++i) {
        ASSERT_TRUE(std::isnan(of_row.inverse_distance[i]));
      }
    }
  });
}

/// Expects finite weights whose sum is the visibility of the point in the best camera with a
/// weight. This is 1, except within a pixel of the images' borders, or 0. Adds to `whole` the
/// number of rays whose weights sum to 1.
void expect_sound_weights(const rig::Rig& rig, const std::vector<WorldRay>& rays,
                          const std::vector<double>& inverse_distance,
                          const RayWeightOptions& weighing, int& whole) {
  weigh_rays(rig, rays, inverse_distance, weighing,
             [&](const std::vector<ChunkWeights>& weights, std::size_t i) {
               double sum = 0, most = 0, seen = 0;
               for (const ChunkWeights& camera : weights) {
                 const double weight = double{camera.weight[i]};
                 ASSERT_TRUE(std::isfinite(weight) && weight >= 0) << weight;
                 sum += weight;
                 seen = std::max(seen, double{camera.seen[i]});
                 if (weight > 0) most = std::max(most, double{camera.seen[i]});
               }
               ASSERT_NEAR(sum, most, 1e-6);
               ASSERT_EQ(most > 0, seen > 0);  // a camera that sees the point has a weight
               whole += most == 1 ? 1 : 0;
             });
}

TEST(LumigraphWeights, SumToOneOrNothingIsSeenAtTheExtremes) {
  testing::for_each_simd_target(kernel_target, [] {
    for (const testing::ExtremeView& extreme : testing::extremes()) {
      SCOPED_TRACE(extreme.name);
      const SyntheticTake take = testing::make_extreme_array(extreme.array);
      schemas::RigDocument document;
      for (schemas::CameraGeometry camera : take.cameras) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          camera.world_from_camera[4 * axis + 3] += take.origin[axis];
        }
        document.cameras.push_back({camera, {}});
      }
      const rig::Rig rig = rig::rig_from_document(document);
      const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(extreme.view);
      const double height = signed_plane_distance(extreme.plane, extreme.view.pose.position);
      std::vector<WorldRay> rays;
      std::vector<double> inverse;
      const int step = std::max(1, extreme.view.width / 500);
      for (int y = 0; y < extreme.view.height; ++y) {
        for (int x = 0; x < extreme.view.width; x += step) {
          const Vector3d ray = (ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1)).normalized();
          const double inverse_distance = -extreme.plane.head<3>().dot(ray) / height;
          if (!(inverse_distance >= 0) || std::isinf(inverse_distance)) continue;  // not in front
          rays.push_back({extreme.view.pose.position, ray});
          inverse.push_back(inverse_distance);
        }
      }
      int whole = 0;
      for (const double weight : {0.0, 1.0, 1e6}) {
        RayWeightOptions weighing;
        weighing.angular = weighing.resolution = weighing.field_of_view = weight;
        for (const int cameras : {1, 4, kMaxWeightedCameras}) {
          weighing.cameras = cameras;
          expect_sound_weights(rig, rays, inverse, weighing, whole);
        }
      }
      EXPECT_EQ(whole > 0, !extreme.blank);
    }
  });
}

TEST(LumigraphWeights, SumToOneOrNothingIsSeenAmongManyCameras) {
  rig::Rig crowd = grid_rig(17, 17);
  rig::Rig one_place = crowd;
  for (rig::Rig::Camera& camera : one_place.cameras) camera.pose = crowd.cameras[0].pose;
  testing::for_each_simd_target(kernel_target, [&] {
    for (const rig::Rig* rig : {&crowd, &one_place}) {
      for (const int cameras : {1, 4, kMaxWeightedCameras}) {
        RayWeightOptions weighing;
        weighing.cameras = cameras;
        int whole = 0;
        for (const auto& [eye, spread] : {std::pair{Vector3d(0.01, 0.02, 0), 3.0},
                                          {Vector3d(0.03, -0.02, 0.8), 3.0},
                                          {Vector3d(-0.48, 0.48, 0), 9.0}}) {
          const SomeRays some = rays_from(eye, spread, {1.0, 1e3});
          expect_sound_weights(*rig, some.rays, some.inverse_distance, weighing, whole);
        }
        EXPECT_GT(whole, 50);
      }
    }
  });
}

TEST(LumigraphWeights, AreFiniteForAnyDistanceAndPenalty) {
  for (const Vector3d& offset : {Vector3d(0, 0, 0), Vector3d(1e7, -1e7, 1e7)}) {
    rig::Rig rig = grid_rig(3, 3);
    for (rig::Rig::Camera& camera : rig.cameras) camera.pose.position += offset;
    for (const double weight : {0.0, 1.0, 1e6}) {
      RayWeightOptions weighing;
      weighing.angular = weighing.resolution = weighing.field_of_view = weight;
      for (const Vector3d& eye : {Vector3d(0, 0, 0), Vector3d(0, 0, 1e-12), Vector3d(0.06, 0.06, 0),
                                  Vector3d(0, 0, 1e6), Vector3d(0, 0, -3), Vector3d(0, 0, -100)}) {
        for (const double distance : {1e-3, 1.0, 1e9, 1e300}) {
          const std::vector<WorldRay> rays(3, {eye + offset, -Vector3d::UnitZ()});
          const std::vector<double> inverse(3, 1 / distance);
          int whole = 0;
          expect_sound_weights(rig, rays, inverse, weighing, whole);
        }
      }
    }
  }
}

TEST(LumigraphWeights, CoincidentCamerasShareAlike) {
  rig::Rig rig = grid_rig(1, 3);
  for (rig::Rig::Camera& camera : rig.cameras) camera.pose = rig.cameras[0].pose;
  RayWeightOptions weighing;
  weighing.cameras = 1;  // all three are also second best
  const WorldRay ray{rig.cameras[0].pose.position + Vector3d(0.02, 0, 0), -Vector3d::UnitZ()};
  const auto fast = weights_of(rig, {ray}, {0.25F}, weighing);
  const auto reference = reference_weights(rig, ray, 0.25, weighing);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(reference[c], 1.0 / 3, 1e-9);
    EXPECT_NEAR(fast[0][c], 1.0 / 3, 0.02);  // 1 - 1 / (1 + kSoftening) in float
  }
}

TEST(LumigraphWeights, ACameraOnTheRayTakesItAndItsNeighboursComeInSmoothly) {
  const rig::Rig rig = grid_rig(5, 5);
  const RayWeightOptions weighing;
  std::vector<double> before;
  for (int step = 0; step <= 600; ++step) {
    const double x = -0.12 + 0.24 * step / 600;  // along the cameras of the middle row and beyond
    const WorldRay ray{{x, 0, 0}, Vector3d(0.05, 0.02, -1).normalized()};
    const auto weights = reference_weights(rig, ray, 0.2, weighing);
    if (step == 300) {
      EXPECT_GT(weights[12], 0.999);  // through the middle camera's centre
    }
    double change = 0;
    for (std::size_t c = 0; c < weights.size() && !before.empty(); ++c) {
      change = std::max(change, std::abs(weights[c] - before[c]));
    }
    EXPECT_LT(change, 0.06) << "at " << x;  // 0.4 mm further; the reach of a camera is 60 mm
    before = weights;
  }
}

TEST(LumigraphWeights, ACameraThatStopsSeeingFadesOut) {
  const rig::Rig rig = grid_rig(1, 2);
  RayWeightOptions weighing;
  const double edge = std::tan(31 * kDegree);
  double before = -1;
  for (int step = 0; step <= 400; ++step) {  // leaves the left camera's image only
    const Vector3d point(-0.03 + 4 * edge * (0.85 + 0.2 * step / 400), 0, -4);
    const Vector3d eye(-0.02, 0, 0);
    const WorldRay ray{eye, (point - eye).normalized()};
    const auto weights = reference_weights(rig, ray, 1 / (point - eye).norm(), weighing);
    if (before >= 0) {
      EXPECT_LT(std::abs(weights[0] - before), 0.06) << step;
    }
    before = weights[0];
    if (step == 0) {
      EXPECT_GT(before, 0.7);
    }
  }
  EXPECT_EQ(before, 0);
}

TEST(LumigraphWeights, ACoarserCameraCountsLess) {
  rig::Rig rig = grid_rig(1, 2);
  rig.cameras[1].pose.position.z() += 1;  // a metre further away
  const WorldRay ray{{0, 0, 0}, -Vector3d::UnitZ()};
  RayWeightOptions weighing;
  weighing.resolution = 0;
  EXPECT_NEAR(reference_weights(rig, ray, 0.25, weighing)[1], 0.5, 0.1);
  weighing.resolution = 1;
  EXPECT_LT(reference_weights(rig, ray, 0.25, weighing)[1], 0.05);
}

// The penalty of the border is in camera spacings, to which a pair of cameras does not belong.
TEST(LumigraphWeights, CamerasNextToEachOtherKeepTheSpacing) {
  rig::Rig rig = grid_rig(3, 3);
  EXPECT_NEAR(mean_nearest_baseline(rig), 0.06, 1e-12);
  for (std::size_t i = 0; i < 9; ++i) {
    rig.cameras.push_back(rig.cameras[i]);
    rig.cameras.back().pose.position.y() += 0.0003;
    EXPECT_NEAR(mean_nearest_baseline(rig), 0.06, 0.0003) << i + 1 << " pairs";
  }
  rig.cameras = std::vector(3, rig.cameras[0]);
  EXPECT_EQ(mean_nearest_baseline(rig), 1);
}

TEST(LumigraphWeights, LeavingOutCamerasThatCannotCountChangesNothing) {
  const rig::Rig rig = grid_rig(9, 9, {-0.1, 0, 0, 0, 0});
  const std::vector<int> all = all_cameras(rig);
  const double spacing = mean_nearest_baseline(rig);
  const RayWeightOptions weighing;
  std::size_t chosen_in_total = 0;
  int bundles = 0;
  for (const Vector3d& eye :
       {Vector3d(0.01, 0.02, 0), Vector3d(0, 0, 0.5), Vector3d(0.1, 0, -0.5)}) {
    const VirtualCamera view = virtual_camera_with_fov(640, 480, 50 * kDegree, make_pose(eye, 2));
    const Eigen::Matrix3d ray_of = world_ray_from_pixel(view);
    for (int y = 0; y < 480; y += 48) {
      for (int x = 0; x < 640; x += 64) {
        const auto direction = [&](double dx, double dy) {
          return Vector3d((ray_of * Vector3d(x + dx, y + dy, 1)).normalized());
        };
        const RayBundle bundle{
            eye,
            {direction(0, 0), direction(64, 0), direction(0, 16), direction(64, 16)},
            0.2,
            0.22};
        const std::vector<int> chosen =
            select_candidate_cameras(rig, all, bundle, weighing, spacing);
        chosen_in_total += chosen.size();
        ++bundles;
        for (const auto& [dx, dy, inverse] : {std::tuple{0.5, 0.5, 0.2},
                                              {63.5, 15.5, 0.22},
                                              {30.0, 8.0, 0.21},
                                              {2.0, 14.0, 0.22}}) {
          const WorldRay ray{eye, direction(dx, dy)};
          const auto few =
              compute_camera_weights_reference(rig, chosen, ray, inverse, weighing, spacing);
          const auto whole =
              compute_camera_weights_reference(rig, all, ray, inverse, weighing, spacing);
          ASSERT_EQ(few.size(), whole.size());
          for (std::size_t i = 0; i < few.size(); ++i) {
            ASSERT_EQ(few[i].camera, whole[i].camera);
            ASSERT_EQ(few[i].weight, whole[i].weight);
          }
        }
      }
    }
  }
  EXPECT_LT(chosen_in_total, 30U * static_cast<unsigned>(bundles));  // of 81
}

}  // namespace
}  // namespace raystage::render
