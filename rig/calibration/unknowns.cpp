// SPDX-License-Identifier: Apache-2.0
#include "rig/calibration/unknowns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace raystage {

using Eigen::Index;
using Eigen::VectorXd;

Layout layout_of(const ArrayModel& model, const BundleSettings& free) {
  Layout layout;
  std::vector<bool> counts(model.cameras.size(), false);
  for (const ArrayModel::Observation& o : model.observations) {
    if (model.counts(o)) counts[static_cast<std::size_t>(o.camera)] = true;
  }
  if (free.lens != LensFreedom::kNone) {
    const std::vector<int> held = held_values(free.lens);
    for (int i = 0; i < kLensValues; ++i) {
      if (std::ranges::find(held, i) == held.end()) layout.lens_values.push_back(i);
    }
  }
  layout.fy_follows = free.lens != LensFreedom::kNone && free.lens != LensFreedom::kWholeModel;
  Index shared = kHeld;
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    const bool rests = i < free.held_cameras.size() && free.held_cameras[i];
    layout.pose.push_back(counts[i] && !rests ? layout.size : kHeld);
    if (layout.pose.back() != kHeld) layout.size += kPoseValues;
    Index lens = kHeld;
    if (counts[i] && !layout.lens_values.empty()) {
      lens = shared;
      if (lens == kHeld) {
        lens = layout.size;
        layout.size += static_cast<Index>(layout.lens_values.size());
        if (free.shared_lens) shared = lens;
      }
    }
    layout.lens.push_back(lens);
  }
  return layout;
}

VectorXd tolerances_of(const ArrayModel& model, const Layout& layout, const Tolerances& t) {
  VectorXd result = VectorXd::Ones(layout.size);
  const double place = t.place * neighbour_distance(model);
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    const ArrayModel::Camera& camera = model.cameras[i];
    if (layout.pose[i] != kHeld) {
      result.segment<3>(layout.pose[i]).setConstant(t.turn_deg * std::numbers::pi / 180);
      result.segment<3>(layout.pose[i] + 3).setConstant(place > 0 ? place : 1);
    }
    if (layout.lens[i] == kHeld) continue;
    const double f = camera.intrinsics.fx;
    const double r = std::hypot(camera.width / 2.0, camera.height / 2.0) / f;
    const double corner = t.corner_px / f;
    const LensValues of_values{
        t.focal_length * f,      t.focal_length * f,   t.middle * camera.width,
        t.middle * camera.width, corner / (r * r * r), corner / std::pow(r, 5),
        corner / (3 * r * r),    corner / (3 * r * r), corner / std::pow(r, 7)};
    for (std::size_t k = 0; k < layout.lens_values.size(); ++k) {
      result[layout.lens[i] + static_cast<Index>(k)] =
          of_values[static_cast<std::size_t>(layout.lens_values[k])];
    }
  }
  return result;
}

double largest_effect(const VectorXd& direction, const Layout& layout) {
  double most = 0;
  for (std::size_t i = 0; i < layout.pose.size(); ++i) {
    if (layout.pose[i] != kHeld) {
      most = std::max(most, direction.segment<kPoseValues>(layout.pose[i]).cwiseAbs().maxCoeff());
    }
    if (layout.lens[i] == kHeld) continue;
    std::array<double, 4> radial{};  // at so many shares of the corner's distance
    for (std::size_t k = 0; k < layout.lens_values.size(); ++k) {
      const double value = direction[layout.lens[i] + static_cast<Index>(k)];
      const int which = layout.lens_values[k];
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

Uncertainty::Direction described(const VectorXd& direction, double deviation,
                                 const Layout& layout) {
  Uncertainty::Direction d;
  d.deviation = deviation;
  const double all = direction.squaredNorm();
  std::vector<double> of_camera(layout.pose.size(), 0);
  std::vector<bool> told(static_cast<std::size_t>(layout.size), false);  // shared lenses once
  for (std::size_t i = 0; i < layout.pose.size(); ++i) {
    if (layout.pose[i] != kHeld) {
      const double turn = direction.segment<3>(layout.pose[i]).squaredNorm() / all;
      const double place = direction.segment<3>(layout.pose[i] + 3).squaredNorm() / all;
      d.turns += turn;
      d.places += place;
      of_camera[i] = turn + place;
    }
    if (layout.lens[i] == kHeld || told[static_cast<std::size_t>(layout.lens[i])]) continue;
    told[static_cast<std::size_t>(layout.lens[i])] = true;
    for (std::size_t k = 0; k < layout.lens_values.size(); ++k) {
      const double component = direction[layout.lens[i] + static_cast<Index>(k)];
      const double share = component * component / all;
      const int value = layout.lens_values[k];
      (value < 2 ? d.focal_length : value < 4 ? d.middle : d.distortion) += share;
    }
  }
  const double poses = d.turns + d.places;
  for (std::size_t i = 0; i < of_camera.size(); ++i) {
    if (poses > 0 && of_camera[i] > 0.4 * poses) d.cameras.push_back(static_cast<int>(i));
  }
  return d;
}

}  // namespace raystage
