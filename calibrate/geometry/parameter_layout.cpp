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

namespace raystage::calibrate {

using Eigen::Index;
using Eigen::VectorXd;

ParameterLayout make_parameter_layout(const ArrayModel& model,
                                      const BundleAdjustmentOptions& free) {
  ParameterLayout layout;
  std::vector<bool> counts(model.cameras.size(), false);
  for (const ArrayModel::Observation& o : model.observations) {
    if (model.counts(o)) counts[o.camera] = true;
  }
  if (free.lens != LensRefinement::kNone) {
    const std::vector<int> held = fixed_lens_parameters(free.lens);
    for (int i = 0; i < kLensParameterCount; ++i) {
      if (std::ranges::find(held, i) == held.end()) layout.free_lens_parameters.push_back(i);
    }
  }
  layout.square_pixels =
      free.lens != LensRefinement::kNone && free.lens != LensRefinement::kFullModel;
  Index shared = kFixed;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    const bool rests = i < free.fixed_cameras.size() && free.fixed_cameras[i];
    layout.pose.push_back(counts[i] && !rests ? layout.size : kFixed);
    if (layout.pose.back() != kFixed) layout.size += kPoseParameterCount;
    Index lens = kFixed;
    if (counts[i] && !layout.free_lens_parameters.empty()) {
      lens = shared;
      if (lens == kFixed) {
        lens = layout.size;
        layout.size += static_cast<Index>(layout.free_lens_parameters.size());
        if (free.shared_lens) shared = lens;
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
    const double r = std::hypot(camera.width / 2.0, camera.height / 2.0) / f;
    const double corner = t.corner_px / f;
    const LensParameters of_values{t.focal_length * f,
                                   t.focal_length * f,
                                   t.principal_point * camera.width,
                                   t.principal_point * camera.width,
                                   corner / (r * r * r),
                                   corner / std::pow(r, 5),
                                   corner / (3 * r * r),
                                   corner / (3 * r * r),
                                   corner / std::pow(r, 7)};
    for (std::size_t k = 0; k < layout.free_lens_parameters.size(); ++k) {
      result[layout.lens[i] + static_cast<Index>(k)] = of_values[layout.free_lens_parameters[k]];
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
    for (std::size_t k = 0; k < layout.free_lens_parameters.size(); ++k) {
      const double value = direction[layout.lens[i] + static_cast<Index>(k)];
      const int which = layout.free_lens_parameters[k];
      const int power = which == 4 ? 3 : which == 5 ? 5 : which == 8 ? 7 : 0;
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
    for (std::size_t k = 0; k < layout.free_lens_parameters.size(); ++k) {
      const double component = direction[layout.lens[i] + static_cast<Index>(k)];
      const double share = component * component / all;
      const int value = layout.free_lens_parameters[k];
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
