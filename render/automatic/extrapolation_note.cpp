// SPDX-License-Identifier: Apache-2.0
#include "render/automatic/extrapolation_note.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rig/plenoptic_sampling.h"

namespace raystage::render {

std::optional<std::string> extrapolation_note(const VirtualCamera& view,
                                              const LightFieldFrame& instant) {
  const rig::Rig& rig = *instant.rig;
  const auto offset_from = [&](int camera) -> Eigen::Vector3d {
    return view.pose.position - rig.cameras[camera].pose.position;
  };
  const int nearest = *std::ranges::min_element(
      instant.included_cameras, {}, [&](int camera) { return offset_from(camera).squaredNorm(); });
  const Eigen::Vector3d offset = offset_from(nearest);
  const double distance = offset.norm();
  if (distance <= rig::max_neighbour_baseline(rig, *instant.complete)) return std::nullopt;
  // "In front of" or "behind": more than half of the distance is along the normal.
  const double behind = offset.dot(instant.complete->normal);
  const char* side = "next to";
  if (std::abs(behind) > distance / 2) side = behind > 0 ? "behind" : "in front of";
  return fmt::format(
      "the view is {:.1g} m {} the array, where quality cannot be measured: it may be "
      "lower",
      distance, side);
}

}  // namespace raystage::render
