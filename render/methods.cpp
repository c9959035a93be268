// SPDX-License-Identifier: Apache-2.0
#include "render/methods.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/error.h"
#include "render/automatic/automatic.h"
#include "render/depth/depth.h"
#include "render/hull/visual_hull.h"
#include "render/lumigraph/lumigraph_method.h"
#include "render/planar/aperture.h"
#include "render/planar/focal_plane.h"
#include "render/slabs/slabs.h"
#include "render/sweep/plane_sweep.h"

namespace raystage::render {

std::span<const Method* const> methods() {
  static const std::array all{&focal_plane_method(), &nearest_method(),     &aperture_method(),
                              &lumigraph_method(),   &slabs_method(),       &plane_sweep_method(),
                              &depth_method(),       &visual_hull_method(), &automatic_method()};
  return all;
}

const Method* find_method(std::string_view name) {
  const auto found = std::ranges::find(methods(), name, &Method::name);
  return found != methods().end() ? *found : nullptr;
}

std::string method_names() {
  std::string names;
  for (const Method* method : methods()) {
    names += (names.empty() ? "" : ", ") + std::string(method->name());
  }
  return names;
}

const Method& method_named(std::string_view name) {
  if (const Method* found = find_method(name)) return *found;
  throw Error::bad_input("there is no reconstruction method '" + std::string(name) + "'", "method",
                         "Methods: " + method_names());
}

std::string describe_methods() {
  std::string text;
  for (const Method* method : methods()) {
    text += "\n" + std::string(method->name()) + " = " + std::string(method->description().summary);
    for (const OptionSpec& option : method->options()) text += "\n    " + describe_option(option);
    for (const MethodPreset& preset : method->presets()) {
      text += fmt::format("\n    preset {}: {}", preset.name, preset.options);
    }
  }
  return text;
}

}  // namespace raystage::render
