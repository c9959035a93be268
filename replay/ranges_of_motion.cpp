// SPDX-License-Identifier: Apache-2.0
// The ranges of motion that the map draws. Cost: milliseconds once for each light field, and about
// 50 microseconds for a view.
#include "replay/ranges_of_motion.h"

#include <utility>

#include "compose/layers/light_field_layer.h"
#include "rig/planning/range_of_motion.h"

namespace raystage::replay {

RangesOfMotion::RangesOfMotion(const compose::ShotPlan& plan) {
  for (const compose::LightFieldLayer* layer : plan.light_fields()) {
    if (auto recorded = rig::recorded_array(layer->take().rig())) {
      arrays_.push_back({layer->index(), std::move(recorded->array), recorded->is_ideal});
    }
  }
}

std::vector<RangesOfMotion::Range> RangesOfMotion::of_view(const render::VirtualCamera& view,
                                                           double interaxial) const {
  const rig::ViewFrustum frustum{rig::camera_slopes(view.intrinsics, view.width, view.height),
                                 view.pose.world_from_camera_rotation, interaxial};
  std::vector<Range> ranges;
  for (const Array& one : arrays_) {
    Range range{one.layer, {}, one.is_exact};
    const rig::RangeOfMotion found = rig::range_of_motion(one.array, frustum);
    for (const Eigen::Vector3d& vertex : found.positions.vertices()) {
      range.vertices.push_back(one.array.pose.world_from_camera(vertex));
    }
    ranges.push_back(std::move(range));
  }
  return ranges;
}

}  // namespace raystage::replay
