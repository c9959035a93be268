// SPDX-License-Identifier: Apache-2.0
#include "replay/nested_ranges.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "base/cancellation.h"
#include "base/error.h"
#include "compose/layers/light_field_layer.h"
#include "planning/combined_coverage.h"
#include "planning/coverage_plan.h"
#include "store/take.h"

namespace raystage::replay {
namespace {

/// Takes that count together.
struct Group {
  std::vector<std::size_t> layers;
  std::vector<planning::NamedRig> rigs;
};

std::vector<Group> groups_of(const compose::ShotPlan& plan) {
  std::vector<Group> groups;
  std::map<std::string, std::size_t> of_volume;
  for (const compose::LightFieldLayer* layer : plan.light_fields()) {
    if (plan.is_light(layer->index())) continue;
    const std::string& volume = plan.shot().layers[layer->index()].volume;
    const auto [known, is_new] = of_volume.try_emplace(volume, groups.size());
    if (is_new || volume.empty()) groups.emplace_back();
    Group& group = is_new || volume.empty() ? groups.back() : groups[known->second];
    group.layers.push_back(layer->index());
    const bool is_known = std::ranges::any_of(group.rigs, [&](const planning::NamedRig& other) {
      return planning::have_same_cameras(other.rig, layer->take().rig());
    });
    if (is_known) continue;  // several takes of one array
    group.rigs.push_back({layer->take().document().name, layer->take().rig()});
  }
  return groups;
}

planning::CoveragePlan ranges_of(const Group& group, const planning::CoverageOptions& options,
                                 const std::stop_token& stop) {
  if (group.rigs.size() == 1) {
    return planning::plan_coverage(group.rigs[0].name, group.rigs[0].rig, options, {}, stop);
  }
  return planning::plan_combined_coverage(group.rigs[0].name, group.rigs, options, {}, stop);
}

/// Returns how large the arrays are together, metres.
double extent_of(const Group& group) {
  Eigen::AlignedBox3d box;
  for (const planning::NamedRig& named : group.rigs) {
    for (const rig::Rig::Camera& camera : named.rig.cameras) box.extend(camera.pose.position);
  }
  return box.diagonal().norm();
}

NestedRange range_from(const planning::CoverageVolume& volume, const Group& group,
                       const rig::Pose& array) {
  NestedRange range{group.layers, volume.share, volume.error_m, {}, volume.surface.triangles};
  for (const Eigen::Vector3d& vertex : volume.surface.vertices) {
    range.vertices.push_back(array.world_from_camera(vertex));
  }
  range.is_of_subject = volume.is_of_subject;
  range.empty_because = volume.empty_because;
  return range;
}

/// Returns options for ranges that are drawn small: precise to a hundredth of the array.
planning::CoverageOptions coarse_options(const Group& group) {
  constexpr double kTolerance = 0.01, kLeastTolerance = 1e-5;
  planning::CoverageOptions options;
  options.tolerance_m = std::max(kLeastTolerance, kTolerance * extent_of(group));
  options.max_vertices = 600;
  return options;
}

}  // namespace

std::vector<NestedRange> nested_ranges(const compose::ShotPlan& plan,
                                       const render::VirtualCamera& view, double interaxial,
                                       const std::stop_token& stop) {
  std::vector<NestedRange> ranges;
  for (const Group& group : groups_of(plan)) {
    planning::CoverageOptions options = coarse_options(group);
    options.view = view;
    options.interaxial_m = interaxial;
    planning::CoveragePlan found;
    try {
      found = ranges_of(group, options, stop);
    } catch (const Error&) {
      if (stop.stop_requested()) throw Cancelled();
      continue;  // such as arrays on a line: the picture is shown nevertheless
    }
    for (const planning::CoverageVolume& volume : found.volumes) {
      ranges.push_back(range_from(volume, group, found.array));
    }
  }
  return ranges;
}

std::vector<NestedRange> subject_ranges(const compose::ShotPlan& plan, const Eigen::Vector3d& point,
                                        double size, const std::stop_token& stop) {
  std::vector<NestedRange> ranges;
  for (const Group& group : groups_of(plan)) {
    if (group.rigs.size() > 1) {
      ranges.push_back({.layers = group.layers,
                        .vertices = {},
                        .triangles = {},
                        .is_of_subject = true,
                        .empty_because = "several arrays have no range of a subject together"});
      continue;
    }
    const planning::NamedRig& named = group.rigs.front();
    planning::CoveragePlan found;
    try {
      found = planning::plan_subject_coverage(named.name, named.rig, point, size,
                                              coarse_options(group), stop);
    } catch (const Error&) {
      if (stop.stop_requested()) throw Cancelled();
      throw;
    }
    ranges.push_back(range_from(found.volumes.front(), group, found.array));
  }
  return ranges;
}

}  // namespace raystage::replay
