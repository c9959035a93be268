// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace raystage {

/// Two numbers in [0, 1), evenly spread over all `index`, the same every time: the R2 sequence
/// (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018), turned by a hash of
/// `seed` (Cranley and Patterson, "Randomization of number theoretic methods", 1976).
std::array<double, 2> r2_sample(std::uint32_t seed, std::uint32_t index);

/// A direction around `normal` by Lambert's law: density cos / pi.
Eigen::Vector3d sample_diffuse_direction(const Eigen::Vector3d& normal,
                                         const std::array<double, 2>& at);

struct DirectionSample {
  Eigen::Vector3d direction;
  double weight = 0;  ///< masking, G2 / G1, in [0, 1]; 0 where it would lead into the surface
};

/// A reflection of `towards_eye` off a rough surface, by the normals that are seen (Heitz,
/// "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018). `alpha`: GGX', above 0.
DirectionSample sample_ggx_direction(const Eigen::Vector3d& normal,
                                     const Eigen::Vector3d& towards_eye, double alpha,
                                     const std::array<double, 2>& at);

/// `direction` reflect; unit.
Eigen::Vector3d reflect(const Eigen::Vector3d& direction, const Eigen::Vector3d& normal);

}  // namespace raystage
