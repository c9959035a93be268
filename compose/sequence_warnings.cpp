// SPDX-License-Identifier: Apache-2.0
#include "compose/sequence_warnings.h"

#include <fmt/format.h>

#include <algorithm>

#include "render/methods.h"
#include "schemas/rig_document.h"

namespace raystage {
namespace {

/// What people do not expect of a focus that moves.
void say_what_focus_means(const ShotPlan& plan, std::size_t layer, const SequenceOptions& options) {
  using Kind = ShotDocument::FocalPlane::Kind;
  const LightFieldLayer& light_field = *plan.light_field(layer);
  const Kind kind = plan.shot().layers[layer].focal_plane.kind;
  if (kind != Kind::kKeys && kind != Kind::kCamera) return;
  const Method& method = method_named(light_field.reconstruction().method);
  if (!method.uses_focal_plane()) {
    options.on_message(
        fmt::format("{}the method {} finds the scene's depth and pays no heed to the focal "
                    "plane: nothing is pulled",
                    layer_label(plan, layer), method.name()));
  } else if (plan.shot().merge == ShotDocument::Merge::kDepth && plan.layers() > 1) {
    options.on_message(
        fmt::format("{}all of the light field stands at its focal plane, and moves with it before "
                    "and behind other layers",
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
    say_what_focus_means(plan, i, options);
    if (!is_calibrated(read_rig(light_field->take().folder() / "rig.json"))) {
      options.on_message(
          "warning: " + of_layer +
          "the rig is not calibrated: places and lenses of the cameras are guessed, and "
          "the frames are as wrong as that");
    }
    const auto held = std::ranges::count_if(
        frames, [&](const PlannedFrame& frame) { return frame.shown[i].held; });
    const auto black = std::ranges::count_if(frames, [&](const PlannedFrame& frame) {
      return plan.is_visible(i, frame.frame) && !frame.shown[i].tick;
    });
    if (held > 0) {
      options.on_message(
          fmt::format("{}{} frames hold another instant of the take", of_layer, held));
    }
    if (black > 0) {
      options.on_message(
          fmt::format("{}{} frames are empty: the take has nothing there", of_layer, black));
    }
  }
}

}  // namespace raystage
