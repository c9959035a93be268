// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "render/lumigraph/camera_selection.h"
#include "render/lumigraph/ray_chunk.h"
#include "render/lumigraph/ray_weights.h"
#include "render/sampling/source_view.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"
#include "testing/render/worst_error.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::all_cameras;
using testing::between;
using testing::direction;
using testing::exact;
using testing::exact_projection;
using testing::ExactVector;
using testing::off;
using testing::Real;
using testing::WorstError;

struct Shot {
  rig::Rig rig;
  WorldRay ray;
  double inverse_distance = 0;
};

/// Returns an array and a ray. The ray starts on the array's plane or near it, or up to 1e6 m in
/// front of or behind it.
Shot some_shot() {
  const int width = *rc::gen::element(1, 64, 640, 16384);
  Shot shot{testing::random_rig(width, std::min(width, 480)), {}, 0};
  std::vector<rig::Rig::Camera>& cameras = shot.rig.cameras;
  if (*rc::gen::inRange(0, 6) == 0) {  // all at the same position
    for (rig::Rig::Camera& camera : cameras) camera.pose = cameras[0].pose;
  }
  const rig::Pose& aimed_at_by = cameras[*rc::gen::inRange<std::size_t>(0, cameras.size())].pose;
  const double depth = *rc::gen::element(1e-3, 0.1, 4.0, 1e3, 1e9, 1e15);
  const Vector3d target =
      aimed_at_by.world_from_camera(depth * Vector3d(between(-0.7, 0.7), between(-0.5, 0.5), -1));
  const double height = *rc::gen::element(0.0, 1e-12, -1e-12, 1e-3, 0.1, -0.3, 10.0, 1e6, -1e6);
  const double aside = *rc::gen::element(0.0, 0.0, 0.01, 1.0);  // 0: at a camera's position
  shot.ray.origin = aimed_at_by.world_from_camera({0, 0, height}) + aside * direction();
  const Vector3d way = target - shot.ray.origin;
  const double distance = way.norm();
  RC_PRE(distance > 0);
  shot.ray.direction = way.normalized();
  shot.inverse_distance = *rc::gen::inRange(0, 6) == 0 ? 0 : 1 / distance;
  return shot;
}

struct Rounding {
  double epsilon = 0;
  double towards = 0;  ///< of the vector from the camera to the point, over the point's distance
  double beside = 0;   ///< of the camera's distance from the ray's line, metres
  double further = 0;  ///< of the distance of camera less that of eye from the point, metres
};

/// Returns the rounding of compute_camera_weights_reference(): in double, relative to the eye.
Rounding rounding_in_double(const Shot& shot, const rig::Rig::Camera& camera) {
  const double epsilon = std::numeric_limits<double>::epsilon();
  const double away = (camera.pose.position - shot.ray.origin).norm();
  const double in_distances = away * shot.inverse_distance;
  return {epsilon, 4 * epsilon * (1 + in_distances), 4 * epsilon * away, 16 * epsilon * away};
}

/// Returns the rounding of the kernels: in float, relative to the point of the ray's line nearest
/// to the rig's centre.
Rounding rounding_in_float(const Shot& shot, const rig::Rig::Camera& camera) {
  const double epsilon = std::numeric_limits<float>::epsilon();
  const Vector3d middle = shot.rig.centre();
  const Vector3d from_middle = shot.ray.origin - middle;
  const double eye = from_middle.dot(shot.ray.direction);
  const double base = (from_middle - eye * shot.ray.direction).norm();
  const double away = base + (camera.pose.position - middle).norm();
  const double in_distances =
      std::abs(1 + eye * shot.inverse_distance) + away * shot.inverse_distance;
  const double to_eye = std::abs(eye) + away;
  return {epsilon, 4 * epsilon * in_distances, 4 * epsilon * away, 4 * epsilon * to_eye};
}

/// The penalty of a camera for the ray, and its rounding.
struct Penalty {
  Real value;
  double bound = 0;
  double seen = 0;  ///< visibility of the point, 0 to 1
  Real u, v;        ///< position in the image, pixels
  double position_bound = 0;
};
enum class Sees { kNot, kYes, kRoundingDecides };

/// Computes the penalty as ray_weights.h defines it: with the angle at the point, and distances to
/// it.
Sees exact_penalty(const Shot& shot, const rig::Rig::Camera& camera,
                   const RayWeightOptions& weighing, double spacing, const Rounding& rounding,
                   Penalty& penalty) {
  const ExactVector eye = exact(shot.ray.origin), centre = exact(camera.pose.position);
  const ExactVector given = exact(shot.ray.direction), ray = (1 / norm(given)) * given;
  const bool at_infinity = shot.inverse_distance == 0;
  const Real distance = at_infinity ? Real(1) : 1 / Real(shot.inverse_distance);
  const ExactVector eye_from_point = -distance * ray;
  const ExactVector camera_from_point = centre - (eye + distance * ray);
  const ExactVector towards = at_infinity ? ray : Real(-1) / distance * camera_from_point;

  const schemas::Intrinsics& k = camera.model.intrinsics();
  const double ahead =
      static_cast<double>(-dot(exact(camera.pose.world_from_camera_rotation.col(2)), towards));
  if (std::abs(ahead) <= 4 * rounding.towards) return Sees::kRoundingDecides;
  const auto pixel = exact_projection(k, camera.pose, towards);
  if (!pixel) return Sees::kNot;
  penalty.u = (*pixel)[0];
  penalty.v = (*pixel)[1];
  const Real to_border = std::min({penalty.u, Real(camera.model.width() - penalty.u), penalty.v,
                                   Real(camera.model.height() - penalty.v)});
  const double tangent = static_cast<double>(norm(towards)) / std::abs(ahead);
  penalty.position_bound = 4 * std::max(k.fx, k.fy) * tangent * rounding.towards / ahead +
                           4 * rounding.epsilon * (camera.model.width() + camera.model.height());
  if (abs(to_border) <= penalty.position_bound) return Sees::kRoundingDecides;
  if (to_border < 0) return Sees::kNot;
  const double border = std::max(weighing.border * camera.model.width(), 1.0);
  penalty.seen = std::min(1.0, static_cast<double>(to_border) * double{kBorderFade});
  const Real within = std::min({Real(1), Real(to_border / border), Real(to_border * kBorderFade)});
  const double within_bound =
      penalty.position_bound * double{kBorderFade} / static_cast<double>(within * within);

  const Real sides = norm(eye_from_point) * norm(camera_from_point);
  const Real facing = sides + dot(eye_from_point, camera_from_point);
  const Real beside = norm(cross(ray, centre - eye)), along = dot(ray, centre - eye);
  const double from_line = static_cast<double>(beside);
  const bool behind = !at_infinity && dot(eye_from_point, camera_from_point) < 0;
  // Near the line behind the point, rounding determines the distance from the line.
  if (behind && from_line <= 4 * rounding.beside) return Sees::kRoundingDecides;
  const Real half_tangent =
      at_infinity ? Real(0) : Real(norm(cross(eye_from_point, camera_from_point)) / facing);
  const Real angular =
      at_infinity ? beside : std::min(Real(2 * distance * half_tangent), Real(kMaxAngularPenalty));
  const double facing_over_distances =
      at_infinity ? 2 : static_cast<double>(facing / (distance * distance));
  const double angular_bound =
      behind ? static_cast<double>(angular) *
                   (2 * rounding.beside / from_line +
                    4 * rounding.towards / static_cast<double>(norm(towards)))
             : (2 * rounding.beside + 4 * rounding.towards * static_cast<double>(angular)) /
                   facing_over_distances;
  const Real further = at_infinity ? Real(-along) : Real(norm(camera_from_point) - distance);
  penalty.value = weighing.angular * angular + weighing.resolution * std::max(Real(0), further) +
                  weighing.field_of_view * spacing * (1 / within - 1) + kMinPenalty * spacing;
  penalty.bound = weighing.angular * angular_bound + weighing.resolution * rounding.further +
                  weighing.field_of_view * spacing * within_bound +
                  16 * rounding.epsilon * static_cast<double>(penalty.value);
  return Sees::kYes;
}

struct ExactWeight {
  Penalty penalty;
  bool counts = false;
  Real weight = 0;  ///< 1 in total
  double bound = 0;
};

/// Returns the weights by camera of the rig; nullopt if rounding decides which cameras see the
/// point or contribute.
std::optional<std::vector<ExactWeight>> exact_camera_weights(
    const Shot& shot, const RayWeightOptions& weighing, double spacing,
    Rounding (*rounding_of)(const Shot&, const rig::Rig::Camera&)) {
  std::vector<ExactWeight> weights(shot.rig.cameras.size());
  std::vector<Real> sorted;
  double epsilon = 0, next_bound = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const rig::Rig::Camera& camera = shot.rig.cameras[i];
    const Rounding rounding = rounding_of(shot, camera);
    const Sees sees = exact_penalty(shot, camera, weighing, spacing, rounding, weights[i].penalty);
    if (sees == Sees::kRoundingDecides) return std::nullopt;
    if (sees == Sees::kNot) continue;
    weights[i].counts = true;
    sorted.push_back(weights[i].penalty.value);
    epsilon = rounding.epsilon;
    next_bound = std::max(next_bound, weights[i].penalty.bound);
  }
  std::sort(sorted.begin(), sorted.end());
  const auto k = static_cast<std::size_t>(weighing.cameras);
  const bool all = sorted.size() <= k;
  const Real per_next = all ? Real(0) : 1 / (sorted[k] * (1 + Real(kSoftening)));
  // The k-th smallest of some numbers changes by at most their largest change.
  const double per_next_bound = all ? 0
                                    : static_cast<double>(per_next * per_next) * next_bound +
                                          4 * epsilon * static_cast<double>(per_next);
  Real total = 0;
  double total_bound = 0;
  for (ExactWeight& camera : weights) {
    if (!camera.counts) continue;
    const Real& p = camera.penalty.value;
    if (static_cast<double>(p) <= 2 * camera.penalty.bound) return std::nullopt;
    camera.weight = std::max(Real(0), Real(1 / p - per_next));
    camera.bound = 2 * camera.penalty.bound / static_cast<double>(p * p) + per_next_bound +
                   4 * epsilon / static_cast<double>(p);
    total += camera.weight;
    total_bound += camera.bound;
  }
  if (total == 0 || static_cast<double>(total) <= 2 * total_bound) {
    if (!sorted.empty()) return std::nullopt;
    return weights;
  }
  for (ExactWeight& camera : weights) {
    camera.weight /= total;
    camera.bound = 2 * (camera.bound + static_cast<double>(camera.weight) * total_bound) /
                       static_cast<double>(total) +
                   4 * epsilon;
  }
  return weights;
}

RayWeightOptions some_weighing() {
  RayWeightOptions weighing;
  weighing.cameras = *rc::gen::element(1, 2, 4, kMaxWeightedCameras);
  weighing.angular = *rc::gen::element(1.0, 1.0, 0.0, 1e3);
  weighing.resolution = *rc::gen::element(0.05, 0.05, 0.0, 1.0, 1e3);
  weighing.field_of_view = *rc::gen::element(1.0, 1.0, 0.0);
  weighing.border = *rc::gen::element(0.05, 0.0, 0.5);
  return weighing;
}

TEST(RayWeightsExtremes, OfTheReferenceAreThoseOf50Digits) {
  WorstError weight("reference: weight", 1e-6), position("reference: position, px", 1e-3),
      beside("reference: beside the ray, relative");
  EXPECT_TRUE(rc::check("any array, ray and penalties", [&] {
    const Shot shot = some_shot();
    const RayWeightOptions weighing = some_weighing();
    const double spacing = mean_nearest_baseline(shot.rig);
    const auto found = compute_camera_weights_reference(shot.rig, all_cameras(shot.rig), shot.ray,
                                                        shot.inverse_distance, weighing, spacing);
    double sum = 0;
    for (const WeightedCamera& camera : found) {
      RC_ASSERT(camera.weight > 0 && camera.weight <= 1 + 1e-15);
      RC_ASSERT(camera.pixel.allFinite() && std::isfinite(camera.ray_distance));
      sum += camera.weight;
    }
    RC_ASSERT(found.empty() || std::abs(sum - 1) < 1e-12);
    const auto truth = exact_camera_weights(shot, weighing, spacing, rounding_in_double);
    if (!truth) return;
    std::vector<double> weights(truth->size());
    for (const WeightedCamera& camera : found) {
      const auto i = static_cast<std::size_t>(camera.camera);
      const ExactWeight& of_camera = (*truth)[i];
      RC_ASSERT(of_camera.counts);
      weights[i] = camera.weight;
      const Penalty& penalty = of_camera.penalty;
      position.expect(std::max(off(camera.pixel.x(), penalty.u), off(camera.pixel.y(), penalty.v)),
                      penalty.position_bound);
      const rig::Rig::Camera& rig_camera = shot.rig.cameras[i];
      const ExactVector way = exact(rig_camera.pose.position) - exact(shot.ray.origin);
      const double away = static_cast<double>(norm(way));
      const Real across = norm(cross(exact(shot.ray.direction), way));
      if (away > 0) {
        beside.expect(off(camera.ray_distance, across) / away,
                      rounding_in_double(shot, rig_camera).beside / away);
      }
    }
    for (std::size_t i = 0; i < weights.size(); ++i) {
      weight.expect(off(weights[i], (*truth)[i].weight), (*truth)[i].bound);
    }
  }));
}

TEST(RayWeightsExtremes, OfTheKernelsAreThoseOf50Digits) {
  testing::for_each_simd_target(kernel_target, [] {
    WorstError weight(std::string(kernel_target()) + ": weight", 1e-3),
        position(std::string(kernel_target()) + ": position, px", 0.1),
        sum_of_weights(std::string(kernel_target()) + ": sum of weights");
    EXPECT_TRUE(rc::check("any array, ray and penalties", [&] {
      const Shot shot = some_shot();
      const RayWeightOptions weighing = some_weighing();
      const double spacing = mean_nearest_baseline(shot.rig);
      RayChunk chunk;
      fill_chunk({&shot.ray, 1}, {&shot.inverse_distance, 1}, shot.rig.centre(), chunk);
      const std::vector<ChunkCamera> cameras = chunk_cameras(shot.rig);
      std::vector<const ChunkCamera*> pointers;
      for (const ChunkCamera& camera : cameras) pointers.push_back(&camera);
      std::vector<ChunkWeights> found(cameras.size());
      compute_camera_weights(chunk, pointers, ChunkWeightOptions(weighing, spacing), found);
      double sum = 0, most = 0;
      for (const ChunkWeights& camera : found) {
        RC_ASSERT(std::isfinite(camera.weight[0]) && camera.weight[0] >= 0);
        sum += double{camera.weight[0]};
        if (camera.weight[0] > 0) most = std::max(most, double{camera.seen[0]});
      }
      sum_of_weights.expect(sum - most, 1e-6);
      const auto truth = exact_camera_weights(shot, weighing, spacing, rounding_in_float);
      if (!truth) return;
      for (std::size_t i = 0; i < found.size(); ++i) {
        const ExactWeight& of_camera = (*truth)[i];
        const double bound = of_camera.bound * most + of_camera.penalty.position_bound;
        weight.expect(off(double{found[i].weight[0]}, of_camera.weight * most), bound);
        if (!(found[i].weight[0] > 0)) continue;
        position.expect(std::max(off(double{found[i].u[0]}, of_camera.penalty.u),
                                 off(double{found[i].v[0]}, of_camera.penalty.v)),
                        of_camera.penalty.position_bound);
      }
    }));
  });
}

/// Weights of the cameras by the reference and by the kernels on the current target. The ray meets
/// the scene 1 m ahead of the origin, along -z.
struct Shares {
  std::vector<double> reference, kernels;
};
Shares shares_of(const rig::Rig& rig, const RayWeightOptions& weighing) {
  const WorldRay ray{Vector3d::Zero(), -Vector3d::UnitZ()};
  const double inverse_distance = 1;
  Shares shares{std::vector<double>(rig.cameras.size()), {}};
  for (const WeightedCamera& camera : compute_camera_weights_reference(
           rig, all_cameras(rig), ray, inverse_distance, weighing, 0.1)) {
    shares.reference[camera.camera] = camera.weight;
  }
  RayChunk chunk;
  fill_chunk({&ray, 1}, {&inverse_distance, 1}, rig.centre(), chunk);
  const std::vector<ChunkCamera> cameras = chunk_cameras(rig);
  std::vector<const ChunkCamera*> pointers;
  for (const ChunkCamera& camera : cameras) pointers.push_back(&camera);
  std::vector<ChunkWeights> found(cameras.size());
  compute_camera_weights(chunk, pointers, ChunkWeightOptions(weighing, 0.1), found);
  for (const ChunkWeights& camera : found) shares.kernels.push_back(double{camera.weight[0]});
  return shares;
}

TEST(RayWeightsExtremes, WhoLooksFromBehindThePointOnTheRaysLineGivesWayToAnyOther) {
  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = geometry.height = 100;
  geometry.intrinsics = {100, 100, 50, 50, {}};
  const rig::CameraModel model(geometry);
  const rig::Pose beside{Eigen::Matrix3d::Identity(), {0.3, 0, 0}};
  const Eigen::Matrix3d backwards =
      Eigen::AngleAxisd(std::numbers::pi, Vector3d::UnitY()).toRotationMatrix();
  testing::for_each_simd_target(kernel_target, [&] {
    SCOPED_TRACE(kernel_target());
    for (const double from_line : {0.0, 1e-30, 1e-12, 1e-5, 1e-3}) {
      SCOPED_TRACE(from_line);
      // The camera is 1.5 m behind the point.
      const rig::Pose behind{backwards, {from_line, 0, -2.5}};
      rig::Rig rig;
      rig.cameras = {{"behind", model, behind, {}, {}, {}}, {"beside", model, beside, {}, {}, {}}};
      RayWeightOptions weighing;
      const Shares both = shares_of(rig, weighing);
      // The penalty is slightly above 0.3 m for the camera at the side, and 2 tan(angle / 2) for
      // the one behind.
      const double most = 0.4 * from_line / 6 + 1 / kMaxAngularPenalty;
      EXPECT_LE(both.reference[0], most);
      EXPECT_LE(both.kernels[0], most + 1e-8);  // float resolves the line to 1e-8 m
      EXPECT_NEAR(both.reference[1], 1, 1e-3);
      EXPECT_NEAR(both.kernels[1], 1, 1e-3);

      // With resolution alone: one camera is half a metre further away than the eye, the other 44
      // mm.
      weighing.angular = 0;
      const double least = kMinPenalty * 0.1;
      const double far = 1 / (weighing.resolution * 0.5 + least);
      const double near = 1 / (weighing.resolution * (std::hypot(1, 0.3) - 1) + least);
      const Shares by_distance = shares_of(rig, weighing);
      EXPECT_NEAR(by_distance.reference[0], far / (far + near), 1e-4);
      EXPECT_NEAR(by_distance.kernels[0], far / (far + near), 1e-4);

      rig.cameras.pop_back();
      const Shares alone = shares_of(rig, {});
      EXPECT_EQ(alone.reference[0], 1);
      EXPECT_NEAR(alone.kernels[0], 1, 1e-6);
    }
  });
}

TEST(RayWeightsExtremes, WhoIsLeftOutByABundleHasNoWeightIn50Digits) {
  WorstError weight("chosen for a bundle: weight", 1e-6);
  EXPECT_TRUE(rc::check("any array and bundles of rays", [&] {
    const Shot middle = some_shot();
    const double spacing = mean_nearest_baseline(middle.rig);
    const Vector3d axis = middle.ray.direction, across = axis.unitOrthogonal();
    for (int i = 0; i < 20; ++i) {
      RayWeightOptions weighing = some_weighing();
      weighing.cameras = *rc::gen::inRange(1, 5);
      const double width = *rc::gen::element(1e-6, 1e-3, 0.05);  // radians
      const Vector3d right = width * across, down = axis.cross(right);
      RayBundle bundle{middle.ray.origin, {}, 0, middle.inverse_distance};
      for (std::size_t corner = 0; corner < 4; ++corner) {
        bundle.corners[corner] =
            (axis + (corner % 2 == 0 ? -right : right) + (corner < 2 ? -down : down)).normalized();
      }
      bundle.min_inverse_distance =
          middle.inverse_distance * *rc::gen::element(1.0, 0.999, 0.5, 0.0);
      const std::vector<int> chosen =
          select_candidate_cameras(middle.rig, all_cameras(middle.rig), bundle, weighing, spacing);

      Shot shot = middle;
      shot.ray.direction = (axis + between(-1, 1) * right + between(-1, 1) * down).normalized();
      shot.inverse_distance = between(bundle.min_inverse_distance, bundle.max_inverse_distance);
      const auto truth = exact_camera_weights(shot, weighing, spacing, rounding_in_double);
      if (!truth) continue;
      std::vector<double> weights(truth->size());
      for (const WeightedCamera& camera : compute_camera_weights_reference(
               shot.rig, chosen, shot.ray, shot.inverse_distance, weighing, spacing)) {
        weights[camera.camera] = camera.weight;
      }
      for (std::size_t c = 0; c < weights.size(); ++c) {
        weight.expect(off(weights[c], (*truth)[c].weight), (*truth)[c].bound);
      }
    }
  }));
}

}  // namespace
}  // namespace raystage::render
