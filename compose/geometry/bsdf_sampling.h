// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace raystage::compose {

/// Returns point `index` of a deterministic low-discrepancy sequence in [0, 1)^2. It is the R2
/// sequence (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018), shifted by
/// a hash of `seed` (Cranley and Patterson, "Randomization of number theoretic methods", 1976).
std::array<double, 2> r2_sample(std::uint32_t seed, std::uint32_t index);

/// Returns two tangents and the unit normal as columns (Duff et al., "Building an orthonormal
/// basis, revisited", JCGT 6(1), 2017).
Eigen::Matrix3d basis_around(const Eigen::Vector3d& normal);

/// Returns a unit direction around `normal` with density cos / pi (Lambert). `at`: in [0, 1).
Eigen::Vector3d sample_diffuse_direction(const Eigen::Vector3d& normal,
                                         const std::array<double, 2>& at);

struct DirectionSample {
  Eigen::Vector3d direction;
  double weight = 0;  ///< masking, G2 / G1, in [0, 1]; 0 for a direction into the surface
};

/// Returns a reflection of `towards_eye` at a rough surface, sampled by visible normals (Heitz,
/// "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018). `alpha`: of GGX, above 0.
DirectionSample sample_ggx_direction(const Eigen::Vector3d& normal,
                                     const Eigen::Vector3d& towards_eye, double alpha,
                                     const std::array<double, 2>& at);

/// Returns `direction` mirrored at the plane with this normal, as a unit vector.
Eigen::Vector3d reflect(const Eigen::Vector3d& direction, const Eigen::Vector3d& normal);

}  // namespace raystage::compose
