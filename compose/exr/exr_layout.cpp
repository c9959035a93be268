// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/exr_layout.h"

#include <algorithm>
#include <iterator>

#include "base/error.h"

namespace raystage::compose {
namespace {

constexpr std::string_view kDepth = "depth", kLightField = "lf";

std::string part_name(const ExrLayer& layer, const ExrView& view) {
  const std::string name = layer.name.empty() ? "rgba" : layer.name;
  return view.name.empty() ? name : name + "." + view.name;
}

/// Returns the name of a channel in its part; with the view's name if `view` is not empty. Only
/// names without a layer are those of the default view (`multiView`) if they name none.
std::string channel_name(const ExrLayer& layer, const std::string& channel, const std::string& view,
                         bool is_default_view, ExrLayout layout) {
  // Blender, for one, only reads channels whose names end in a component, and shows those without a
  // layer's name together: each measure of the light field is a layer of its own.
  const bool is_measure = layer.name == kLightField;
  const std::string& group = is_measure ? channel : layer.name;
  std::string name;
  // Z is a standard channel name without a layer.
  if (!group.empty() && (group != kDepth || layout == ExrLayout::kNuke)) name = group + ".";
  if (!view.empty() && !(is_default_view && name.empty())) name += view + ".";
  return name + (is_measure ? "V" : channel);
}

void add_channels(ExrPart& part, std::span<const ExrView> views, std::size_t v, std::size_t l,
                  const std::string& view, ExrLayout layout) {
  const ExrLayer& layer = views[v].layers[l];
  for (std::size_t c = 0; c < layer.channels.size(); ++c) {
    part.channels.push_back(
        {channel_name(layer, layer.channels[c], view, v == 0, layout), v, l, c});
  }
}

}  // namespace

ExrLayout parse_exr_layout(std::string_view name) {
  if (name == "standard") return ExrLayout::kStandard;
  if (name == "single") return ExrLayout::kSingle;
  if (name == "nuke") return ExrLayout::kNuke;
  throw Error::bad_input("the EXR layout \"" + std::string(name) + "\" is unknown", "shot output",
                         "Use standard, single or nuke");
}

std::vector<ExrPart> make_exr_parts(std::span<const ExrView> views, ExrLayout layout) {
  std::vector<ExrPart> parts;
  if (layout != ExrLayout::kStandard) {
    parts.emplace_back();
    for (std::size_t v = 0; v < views.size(); ++v) {
      for (std::size_t l = 0; l < views[v].layers.size(); ++l) {
        add_channels(parts[0], views, v, l, views[v].name, layout);
      }
    }
    return parts;
  }
  for (std::size_t l = 0; l < views[0].layers.size(); ++l) {
    for (std::size_t v = 0; v < views.size(); ++v) {
      const ExrLayer& layer = views[v].layers[l];
      const std::string name = part_name(layer, views[v]);
      auto part = std::ranges::find(parts, name, &ExrPart::name);
      if (part == parts.end()) {
        parts.push_back({name, views[v].name, v, layer.is_colour, {}});
        part = std::prev(parts.end());
      }
      add_channels(*part, views, v, l, "", layout);
    }
  }
  return parts;
}

}  // namespace raystage::compose
