// SPDX-License-Identifier: Apache-2.0
#include "compose/sequence_warnings.h"

#include <fmt/format.h>

#include <algorithm>

#include "render/methods.h"
#include "schemas/rig_document.h"

namespace raystage {
namespace {

/// Reports unexpected effects of a focus pull.
void report_focus_pull(const ShotPlan& plan, std::size_t layer, const SequenceOptions& options) {
  using Kind = ShotDocument::FocalPlane::Kind;
  const LightFieldLayer& light_field = *plan.light_field(layer);
  const Kind kind = plan.shot().layers[layer].focal_plane.kind;
  if (kind != Kind::kKeys && kind != Kind::kCamera) return;
  const Method& method = method_named(light_field.reconstruction().method);
  if (!method.uses_focal_plane()) {
    options.on_message(
        fmt::format("{}method {} estimates depth and ignores the focal plane: the focus pull has "
                    "no effect",
                    layer_label(plan, layer), method.name()));
  } else if (plan.shot().merge == ShotDocument::Merge::kDepth && plan.layers() > 1) {
    options.on_message(fmt::format(
        "{}the whole light field has the depth of its focal plane, and moves with it in "
        "front of and behind other layers",
        layer_label(plan, layer)));
  }
}

}  // namespace

std::string layer_label(const ShotPlan& plan, std::size_t layer) {
  if (plan.layers() == 1) return "";
  const std::string& name = plan.shot().layers[layer].name;
  return name.empty() ? fmt::format("layer {}: ", layer)
                      : fmt::format("layer {} ({}): ", layer, name);
}

void report_sequence_warnings(const ShotPlan& plan, std::span<const PlannedFrame> frames,
                              const SequenceOptions& options) {
  for (std::size_t i = 0; i < plan.layers(); ++i) {
    const LightFieldLayer* light_field = plan.light_field(i);
    if (light_field == nullptr) continue;
    const std::string of_layer = layer_label(plan, i);
    report_focus_pull(plan, i, options);
    if (!is_calibrated(read_rig(light_field->take().folder() / "rig.json"))) {
      options.on_message(
          "warning: " + of_layer +
          "the rig is not calibrated: camera poses and lenses are guesses, and the frames have "
          "the same errors");
    }
    const auto held = std::ranges::count_if(
        frames, [&](const PlannedFrame& frame) { return frame.shown[i].held; });
    const auto black = std::ranges::count_if(frames, [&](const PlannedFrame& frame) {
      return plan.is_visible(i, frame.frame) && !frame.shown[i].tick;
    });
    if (held > 0) {
      options.on_message(fmt::format("{}{} frames show the nearest instant of the take that exists",
                                     of_layer, held));
    }
    if (black > 0) {
      options.on_message(
          fmt::format("{}{} frames are empty: the take has no instant for them", of_layer, black));
    }
  }
}

}  // namespace raystage
