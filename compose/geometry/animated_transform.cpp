// SPDX-License-Identifier: Apache-2.0
// Evaluates a mesh's transform at a fractional frame: translation, rotation and uniform scale, each
// from a curve through its own keys (animation_curves.h). Input: the keys of a shot, at most one
// value of each property per key. Output: world_from_object, metres. Cost: O(log n) for n keys.
#include "compose/geometry/animated_transform.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"

namespace raystage::compose {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

}  // namespace

AnimatedTransform::AnimatedTransform(const schemas::ShotDocument::Geometry& geometry,
                                     const std::string& where) {
  std::vector<CurveKey<Vector3d>> positions;
  std::vector<CurveKey<Quaterniond>> orientations;
  std::vector<CurveKey<double>> scales;
  for (std::size_t i = 0; i < geometry.keys.size(); ++i) {
    const schemas::ShotDocument::TransformKey& key = geometry.keys[i];
    const auto refuse = [&](const char* what) {
      throw Error::bad_input(what, fmt::format("{}/keys/{}", where, i), "Correct the key");
    };
    if (!std::isfinite(key.frame)) refuse("a key's frame is not finite");
    if (key.position) {
      const Vector3d position((*key.position)[0], (*key.position)[1], (*key.position)[2]);
      if (!position.allFinite()) refuse("a key's position is not finite");
      positions.push_back({key.frame, position});
    }
    if (key.orientation) {
      const auto& q = *key.orientation;
      const Quaterniond orientation(q[0], q[1], q[2], q[3]);
      const double norm = orientation.norm();
      if (!std::isfinite(norm) || norm < 1e-6) {
        refuse("a key's orientation is not finite or of length 0");
      }
      orientations.push_back({key.frame, Quaterniond(orientation.coeffs() / norm)});
    }
    if (key.scale) {
      if (!std::isfinite(*key.scale) || !(*key.scale > 0)) {
        refuse("a key's scale is not a number above 0");
      }
      scales.push_back({key.frame, *key.scale});
    }
  }
  if (!positions.empty()) position_ = Curve<Vector3d>(positions);
  if (!orientations.empty()) orientation_ = RotationCurve(orientations);
  if (!scales.empty()) scale_ = Curve<double>(scales);
}

Eigen::Affine3d AnimatedTransform::world_from_object(double frame) const {
  Eigen::Affine3d placed = Eigen::Affine3d::Identity();
  if (position_) placed.translate(position_(frame));
  if (orientation_) placed.rotate(orientation_(frame));
  if (scale_) placed.scale(scale_(frame));
  return placed;
}

}  // namespace raystage::compose
