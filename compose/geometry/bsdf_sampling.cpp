// SPDX-License-Identifier: Apache-2.0
// Samples directions of scattered rays: diffuse (Lambert, density cos / pi) and glossy (GGX visible
// normals: Heitz, JCGT 7(4), 2018; weight: height-correlated Smith masking). The random numbers are
// a scrambled R2 sequence (Roberts, 2018). Input: unit vectors in world coordinates, numbers in
// [0, 1). Output: unit directions and weights in [0, 1]. Cost: constant per direction.
#include "compose/geometry/bsdf_sampling.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace raystage::compose {
using Eigen::Vector3d;

Eigen::Matrix3d basis_around(const Vector3d& n) {
  const double sign = std::copysign(1.0, n.z());
  const double a = -1 / (sign + n.z()), b = n.x() * n.y() * a;
  Eigen::Matrix3d basis;
  basis.col(0) = Vector3d(1 + sign * n.x() * n.x() * a, sign * b, -sign * n.x());
  basis.col(1) = Vector3d(b, sign + n.y() * n.y() * a, -n.y());
  basis.col(2) = n;
  return basis;
}

namespace {

/// Returns Smith's masking of GGX for a direction in the surface's frame.
double masking(const Vector3d& v, double alpha) {
  const double z = v.z() * v.z();
  if (!(z > 0)) return 0;
  const double slope = (1 - std::min(z, 1.0)) / z * alpha * alpha;
  return 2 / (1 + std::sqrt(1 + slope));
}

double fraction(double value) { return value - std::floor(value); }

std::uint32_t scrambled(std::uint32_t value) {  // Wellons, "lowbias32"
  value ^= value >> 16;
  value *= 0x7feb352dU;
  value ^= value >> 15;
  value *= 0x846ca68bU;
  return value ^ (value >> 16);
}

}  // namespace

std::array<double, 2> r2_sample(std::uint32_t seed, std::uint32_t index) {
  constexpr double kPlastic = 1.32471795724474602596, kUnit = 1.0 / 4294967296.0;
  const std::uint32_t first = scrambled(seed), second = scrambled(first ^ 0x9e3779b9U);
  return {fraction(first * kUnit + index / kPlastic),
          fraction(second * kUnit + index / (kPlastic * kPlastic))};
}

Vector3d sample_diffuse_direction(const Vector3d& normal, const std::array<double, 2>& at) {
  const double radius = std::sqrt(at[0]), angle = 2 * std::numbers::pi * at[1];
  return (basis_around(normal) * Vector3d(radius * std::cos(angle), radius * std::sin(angle),
                                          std::sqrt(std::max(1 - at[0], 0.0))))
      .normalized();
}

DirectionSample sample_ggx_direction(const Vector3d& normal, const Vector3d& towards_eye,
                                     double alpha, const std::array<double, 2>& at) {
  const Eigen::Matrix3d world_from_surface = basis_around(normal);
  Vector3d eye = world_from_surface.transpose() * towards_eye;
  eye.z() = std::max(eye.z(), 1e-4);  // shading normals may face away
  eye.normalize();
  const Vector3d stretched = Vector3d(alpha * eye.x(), alpha * eye.y(), eye.z()).normalized();
  const double flat = stretched.x() * stretched.x() + stretched.y() * stretched.y();
  const Vector3d side = flat > 0
                            ? Vector3d(Vector3d(-stretched.y(), stretched.x(), 0) / std::sqrt(flat))
                            : Vector3d::UnitX();
  const Vector3d up = stretched.cross(side);
  const double radius = std::sqrt(at[0]), angle = 2 * std::numbers::pi * at[1];
  const double x = radius * std::cos(angle), half = (1 + stretched.z()) / 2;
  const double y =
      (1 - half) * std::sqrt(std::max(1 - x * x, 0.0)) + half * radius * std::sin(angle);
  const Vector3d facet =
      x * side + y * up + std::sqrt(std::max(1 - x * x - y * y, 0.0)) * stretched;
  const Vector3d micro =
      Vector3d(alpha * facet.x(), alpha * facet.y(), std::max(facet.z(), 0.0)).normalized();
  const Vector3d out = (2 * eye.dot(micro) * micro - eye).normalized();
  DirectionSample result{world_from_surface * out, 0};
  if (!(out.z() > 0)) return result;
  const double of_eye = masking(eye, alpha), of_out = masking(out, alpha);
  result.weight = of_out / (of_eye + of_out - of_eye * of_out);  // height-correlated G2 / G1
  return result;
}

Vector3d reflect(const Vector3d& direction, const Vector3d& normal) {
  return (direction - 2 * direction.dot(normal) * normal).normalized();
}

}  // namespace raystage::compose
