// SPDX-License-Identifier: Apache-2.0
#include "rig/lens_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace raystage::rig {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

double pinhole_fov(const CameraModel& model) {
  const schemas::Intrinsics& lens = model.intrinsics();
  return std::atan(lens.cx / lens.fx) + std::atan((model.width() - lens.cx) / lens.fx);
}

}  // namespace

double recorded_half_angle(const CameraModel& fisheye) {
  const FisheyeLens& lens = *fisheye.fisheye();
  const schemas::Intrinsics& k = fisheye.intrinsics();
  const double corner =
      std::hypot(std::max(std::abs(k.cx), std::abs(fisheye.width() - k.cx)) / k.fx,
                 std::max(std::abs(k.cy), std::abs(fisheye.height() - k.cy)) / k.fy);
  return lens.angle(corner).value_or(lens.largest_angle());
}

std::vector<LensSummary> summarise_lenses(const Rig& rig) {
  std::vector<LensSummary> lenses;
  for (const Rig::Camera& camera : rig.cameras) {
    const schemas::Projection projection = camera.model.intrinsics().projection;
    const double fov =
        kDegrees * (camera.model.fisheye() != nullptr ? 2 * recorded_half_angle(camera.model)
                                                      : pinhole_fov(camera.model));
    auto found = std::ranges::find(lenses, projection, &LensSummary::projection);
    if (found == lenses.end()) found = lenses.insert(lenses.end(), {projection, 0, fov, fov});
    ++found->cameras;
    found->min_fov_deg = std::min(found->min_fov_deg, fov);
    found->max_fov_deg = std::max(found->max_fov_deg, fov);
  }
  std::ranges::stable_sort(lenses, std::ranges::greater{}, &LensSummary::cameras);
  return lenses;
}

const char* projection_title(schemas::Projection projection) {
  switch (projection) {
    case schemas::Projection::kPinhole:
      return "pinhole";
    case schemas::Projection::kFisheye:
      return "fisheye";
    case schemas::Projection::kFtheta:
      return "f-theta";
    case schemas::Projection::kEquisolid:
      return "equisolid";
    case schemas::Projection::kOrthographic:
      return "orthographic";
  }
  return "";
}

std::string format_lenses(const std::vector<LensSummary>& lenses) {
  std::string text;
  for (const LensSummary& lens : lenses) {
    // Rounded: half angles of 1.5708 mean a hemisphere.
    const std::string least = fmt::format("{:.4g}", lens.min_fov_deg);
    const std::string most = fmt::format("{:.4g}", lens.max_fov_deg);
    text += text.empty() ? "" : "; ";
    if (lenses.size() > 1) text += fmt::format("{} ", lens.cameras);
    text += fmt::format("{}, {} degrees", projection_title(lens.projection),
                        least == most ? most : least + " to " + most);
  }
  return text;
}

}  // namespace raystage::rig
