// SPDX-License-Identifier: Apache-2.0
// Maps the free parameters of a bundle adjustment (6 per pose, up to 9 per lens, shared or per
// camera) to one vector, and scales each by its tolerance. Radial distortion terms are compared by
// their joint effect on the picture, at four fractions of the corner's distance from the centre.
// Cost: linear in the number of parameters.
#include "calibrate/geometry/parameter_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "calibrate/geometry/lens_projection.h"

namespace raystage::calibrate {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// Returns the power of the distance that a distortion term multiplies; 0 for other parameters.
int radial_power(const ParameterLayout& layout, std::size_t camera, int parameter) {
  return lens_parameterization(layout.projections[camera])
      .parameters()[static_cast<std::size_t>(parameter)]
      .radial_power;
}

/// Returns the distance of the picture's corner in focal lengths, as far as the lens reaches.
double farthest_distance(const ArrayModel::Camera& camera) {
  const schemas::Intrinsics& lens = camera.intrinsics;
  const double corner = std::hypot(camera.width / 2.0, camera.height / 2.0) / lens.fx;
  const rig::RadialProjection* fisheye = fisheye_projection(lens);
  if (fisheye == nullptr) return corner;
  const double end = fisheye->largest_angle();
  return std::min(corner, fisheye->distance(std::min(end, lens.half_angle.value_or(end))));
}

}  // namespace

ParameterLayout make_parameter_layout(const ArrayModel& model,
                                      const BundleAdjustmentOptions& free) {
  ParameterLayout layout;
  std::vector<bool> counts(model.cameras.size(), false);
  for (const ArrayModel::Observation& o : model.observations) {
    if (model.counts(o)) counts[o.camera] = true;
  }
  for (const ArrayModel::Camera& camera : model.cameras) {
    layout.projections.push_back(camera.intrinsics.projection);
    layout.free_lens_parameters.emplace_back();
    const std::vector<int> held = fixed_lens_parameters(free.lens, camera.intrinsics.projection);
    for (int i = 0; i < kLensParameterCount; ++i) {
      if (std::ranges::find(held, i) == held.end()) layout.free_lens_parameters.back().push_back(i);
    }
  }
  const bool is_shared = shares_one_lens(model, free);
  layout.square_pixels =
      free.lens != LensRefinement::kNone && free.lens != LensRefinement::kFullModel;
  Index shared = kFixed;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    const bool rests = i < free.fixed_cameras.size() && free.fixed_cameras[i];
    layout.pose.push_back(counts[i] && !rests ? layout.size : kFixed);
    if (layout.pose.back() != kFixed) layout.size += kPoseParameterCount;
    Index lens = kFixed;
    if (counts[i] && !layout.free_lens_parameters[i].empty()) {
      lens = shared;
      if (lens == kFixed) {
        lens = layout.size;
        layout.size += static_cast<Index>(layout.free_lens_parameters[i].size());
        if (is_shared) shared = lens;
      }
    }
    layout.lens.push_back(lens);
  }
  return layout;
}

VectorXd parameter_tolerances(const ArrayModel& model, const ParameterLayout& layout,
                              const Tolerances& t) {
  VectorXd result = VectorXd::Ones(layout.size);
  const double position = t.position * median_neighbour_distance(model);
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    const ArrayModel::Camera& camera = model.cameras[i];
    if (layout.pose[i] != kFixed) {
      result.segment<3>(layout.pose[i]).setConstant(t.rotation_deg * std::numbers::pi / 180);
      result.segment<3>(layout.pose[i] + 3).setConstant(position > 0 ? position : 1);
    }
    if (layout.lens[i] == kFixed) continue;
    const double f = camera.intrinsics.fx;
    const double r = farthest_distance(camera);
    const double corner = t.corner_px / f;
    const auto tolerance_of = [&](int which) {
      if (which < 2) return t.focal_length * f;
      if (which < 4) return t.principal_point * camera.width;
      const int power = radial_power(layout, i, which);
      if (power == 3) return corner / (r * r * r);
      return power > 0 ? corner / std::pow(r, power) : corner / (3 * r * r);
    };
    for (std::size_t k = 0; k < layout.free_lens_parameters[i].size(); ++k) {
      result[layout.lens[i] + static_cast<Index>(k)] =
          tolerance_of(layout.free_lens_parameters[i][k]);
    }
  }
  return result;
}

double max_effect(const VectorXd& direction, const ParameterLayout& layout) {
  double most = 0;
  for (std::size_t i = 0; i < layout.pose.size(); ++i) {
    if (layout.pose[i] != kFixed) {
      most = std::max(most,
                      direction.segment<kPoseParameterCount>(layout.pose[i]).cwiseAbs().maxCoeff());
    }
    if (layout.lens[i] == kFixed) continue;
    std::array<double, 4> radial{};  // at four fractions of the corner's distance
    for (std::size_t k = 0; k < layout.free_lens_parameters[i].size(); ++k) {
      const double value = direction[layout.lens[i] + static_cast<Index>(k)];
      const int power = radial_power(layout, i, layout.free_lens_parameters[i][k]);
      if (power == 0) most = std::max(most, std::abs(value));
      for (std::size_t r = 0; r < radial.size() && power > 0; ++r) {
        radial[r] += value * std::pow(static_cast<double>(r + 1) / radial.size(), power);
      }
    }
    for (const double at : radial) most = std::max(most, std::abs(at));
  }
  return most;
}

Uncertainty::Direction summarise_direction(const VectorXd& direction, double deviation,
                                           const ParameterLayout& layout) {
  Uncertainty::Direction d;
  d.deviation = deviation;
  const double all = direction.squaredNorm();
  std::vector<double> of_camera(layout.pose.size(), 0);
  // counts shared lenses once
  std::vector<bool> is_set(static_cast<std::size_t>(layout.size), false);
  for (std::size_t i = 0; i < layout.pose.size(); ++i) {
    if (layout.pose[i] != kFixed) {
      const double turn = direction.segment<3>(layout.pose[i]).squaredNorm() / all;
      const double position = direction.segment<3>(layout.pose[i] + 3).squaredNorm() / all;
      d.rotations += turn;
      d.positions += position;
      of_camera[i] = turn + position;
    }
    if (layout.lens[i] == kFixed || is_set[layout.lens[i]]) continue;
    is_set[layout.lens[i]] = true;
    for (std::size_t k = 0; k < layout.free_lens_parameters[i].size(); ++k) {
      const double component = direction[layout.lens[i] + static_cast<Index>(k)];
      const double share = component * component / all;
      const int value = layout.free_lens_parameters[i][k];
      (value < 2 ? d.focal_length : value < 4 ? d.principal_point : d.distortion) += share;
    }
  }
  const double poses = d.rotations + d.positions;
  for (std::size_t i = 0; i < of_camera.size(); ++i) {
    if (poses > 0 && of_camera[i] > 0.4 * poses) d.cameras.push_back(static_cast<int>(i));
  }
  return d;
}

}  // namespace raystage::calibrate
