// SPDX-License-Identifier: Apache-2.0
#include "compose/draft_shot.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"

namespace raystage::compose {
namespace {

using schemas::ShotDocument;

int scaled(int pixels, double scale, int least) {
  return std::max(least, static_cast<int>(std::lround(pixels * scale)));
}

void change_method(ShotDocument::Layer& layer, const DraftOptions& draft) {
  if (!draft.method.empty() && draft.method != layer.method) {
    layer.method = draft.method;
    // The depth range is that of the scene; other options are those of the former method.
    std::erase_if(layer.options, [](const auto& option) {
      return option.first != "near" && option.first != "far";
    });
  }
  for (const auto& [name, value] : draft.options) layer.options[name] = value;
}

void select_layers(ShotDocument& shot, const std::vector<std::string>& selected,
                   const std::string& where) {
  std::vector<bool> is_selected(shot.layers.size(), false);
  std::vector<std::string> names;
  for (const ShotDocument::Layer& layer : shot.layers) {
    if (!layer.name.empty()) names.push_back(layer.name);
  }
  for (const std::string& wanted : selected) {
    bool found = false;
    for (std::size_t i = 0; i < shot.layers.size(); ++i) {
      if (shot.layers[i].name != wanted && parse_number<std::size_t>(wanted) != i) continue;
      is_selected[i] = found = true;
    }
    if (found) continue;
    throw Error::bad_input(
        fmt::format("the shot has no layer \"{}\"", wanted), where,
        fmt::format("Name one of its {} layers by its number, from 0{}{}", shot.layers.size(),
                    names.empty() ? "" : ", or by its name: ", fmt::join(names, ", ")));
  }
  for (std::size_t i = 0; i < shot.layers.size(); ++i) {
    if (!is_selected[i]) shot.layers[i].opacity = 0;
  }
}

}  // namespace

bool DraftOptions::is_draft() const {
  return !method.empty() || !options.empty() || scale != 1 || camera_step != 1 || !layers.empty();
}

ShotDocument draft_of_shot(ShotDocument shot, const DraftOptions& draft, const std::string& where) {
  if (!(draft.scale > 0 && draft.scale <= 1)) {
    throw Error::bad_input(fmt::format("the scale is {}, allowed: above 0, up to 1", draft.scale),
                           where, "Use for example 1/4");
  }
  for (ShotDocument::Layer& layer : shot.layers) {
    if (layer.is_light_field()) change_method(layer, draft);
  }
  if (!draft.layers.empty()) select_layers(shot, draft.layers, where);
  shot.width = scaled(shot.width, draft.scale, 1);
  shot.height = scaled(shot.height, draft.scale, 1);
  if (shot.camera.projection == ShotDocument::Camera::Projection::kEquirectangular) {
    shot.width = 2 * shot.height;
  }
  for (int& pixels : shot.output.overscan) pixels = scaled(pixels, draft.scale, 0);
  return shot;
}

double parse_scale(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto first = parse_number<double>(std::string_view(text).substr(0, slash));
  const auto second = slash == std::string::npos
                          ? std::optional(1.0)
                          : parse_number<double>(std::string_view(text).substr(slash + 1));
  const double scale = first && second ? *first / *second : 0;
  if (scale > 0 && scale <= 1) return scale;
  throw Error::bad_input(
      fmt::format("found \"{}\", allowed: a number or ratio above 0, up to 1", text), "scale",
      "Use for example 1/4 or 0.25");
}

}  // namespace raystage::compose
