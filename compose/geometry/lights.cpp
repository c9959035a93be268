// SPDX-License-Identifier: Apache-2.0
// Samples lights with a size over the cone in which a point sees them (uniform in solid angle:
// Shirley, Wang and Zimmerman, "Monte Carlo techniques for direct lighting calculations", ACM TOG
// 15(1), 1996). A cone of half angle a has the solid angle 2 pi (1 - cos a), and a facing surface
// receives pi sin^2 a of its radiance. Input: world coordinates, metres. Cost: constant per
// direction.
#include "compose/geometry/lights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "compose/geometry/bsdf_sampling.h"

namespace raystage::compose {

using Eigen::Vector3d;

namespace {

/// Returns the distance at which a point in or on a sphere sees it.
double distance_from(const DirectLight& light, const Vector3d& point) {
  constexpr double kNearest = 1e-6;  // metres: the light of a point has no upper limit
  return std::max({(*light.position - point).norm(), light.radius, kNearest});
}

}  // namespace

double light_strength(const DirectLight& light, const Vector3d& point) {
  if (!light.position) return 1;
  const double distance = distance_from(light, point);
  return 1 / (distance * distance);
}

LightSample sample_light(const DirectLight& light, const Vector3d& point,
                         const std::array<double, 2>& at) {
  LightSample sample{light.towards, std::numeric_limits<double>::infinity(),
                     light_strength(light, point)};
  double sine = std::sin(light.half_angle), to_centre = 0;
  if (light.position) {
    const Vector3d centre = *light.position - point;
    to_centre = centre.norm();
    if (to_centre > 0) sample.towards = centre / to_centre;
    sine = light.radius / distance_from(light, point);
    sample.distance = std::max(to_centre - light.radius, 0.0);
  }
  if (!(sine > 0)) return sample;
  const double least_cosine = std::sqrt(std::max(0.0, 1 - sine * sine));
  const double cosine = 1 - at[0] * (1 - least_cosine);
  const double out = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const double around = 2 * std::numbers::pi * at[1];
  sample.towards = basis_around(sample.towards) *
                   Vector3d(out * std::cos(around), out * std::sin(around), cosine);
  sample.strength *= 2 / (1 + least_cosine);  // pi sin^2 a over the mean cosine and solid angle
  if (light.position && to_centre > light.radius) {
    // To the sphere's surface in this direction.
    const double beside = to_centre * out;
    const double inside = std::sqrt(std::max(0.0, light.radius * light.radius - beside * beside));
    sample.distance = to_centre * cosine - inside;
  }
  return sample;
}

}  // namespace raystage::compose
