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

LightSample sample_light(const DirectLight& light, const Vector3d& point,
                         const std::array<double, 2>& at) {
  LightSample sample;
  sample.towards = light.towards;
  sample.distance = std::numeric_limits<double>::infinity();
  double sine = std::sin(light.half_angle);
  if (light.position) {
    constexpr double kNearest = 1e-6;  // metres: the light of a point has no upper limit
    const Vector3d to_centre = *light.position - point;
    const double length = to_centre.norm();
    const double distance = std::max({length, light.radius, kNearest});
    if (length > 0) sample.towards = to_centre / length;
    sine = std::min(light.radius / distance, 1.0);
    sample.strength = 1 / (distance * distance);
    sample.distance = std::max(length - light.radius, 0.0);
  }
  if (!(sine > 0)) return sample;
  const double least_cosine = std::sqrt(std::max(0.0, 1 - sine * sine));
  const double cosine = 1 - at[0] * (1 - least_cosine);
  const double out = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const double around = 2 * std::numbers::pi * at[1];
  sample.towards = basis_around(sample.towards) *
                   Vector3d(out * std::cos(around), out * std::sin(around), cosine);
  sample.strength *= 2 / (1 + least_cosine);  // pi sin^2 a over the mean cosine and solid angle
  return sample;
}

}  // namespace raystage::compose
