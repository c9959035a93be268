// SPDX-License-Identifier: Apache-2.0
// Wraps OpenColorIO. A transform counts as linear if it maps some test colours as the matrix of its
// responses to the three unit colours does, up to 1e-4. Others are applied to colours that are
// divided by alpha. Spaces are found by name, alias, role or ASWF's ColorInterop id. Cost: linear
// in pixels.
#include "compose/color/color_config.h"

#include <OpenColorIO/OpenColorIO.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "compose/color/built_in_config.h"

namespace raystage::compose {
namespace {

namespace OCIO = OCIO_NAMESPACE;

/// Names in configs of the spaces of ASWF's ColorInterop list, the usual ones first.
struct InteropSpace {
  std::string_view id;
  std::array<const char*, 7> names;
};
constexpr std::array<InteropSpace, 3> kInteropSpaces{
    {{"lin_rec709_scene",
      {"lin_rec709_scene", "Linear Rec.709 (sRGB)", "lin_rec709", "lin_srgb",
       "Utility - Linear - Rec.709", "Utility - Linear - sRGB", "Linear sRGB"}},
     {"lin_ap1_scene",
      {"lin_ap1_scene", "ACEScg", "ACES - ACEScg", "lin_ap1", "acescg", nullptr, nullptr}},
     {"lin_ap0_scene",
      {"lin_ap0_scene", "ACES2065-1", "ACES - ACES2065-1", "aces2065_1", "lin_ap0", nullptr,
       nullptr}}}};

/// Returns the config's name of the space with this name, alias or role; empty if there is none.
std::string own_name(const OCIO::Config& config, const char* name) {
  const OCIO::ConstColorSpaceRcPtr space = config.getColorSpace(name);
  return space ? space->getName() : "";
}

std::string space_by_interop_id(const OCIO::Config& config, std::string_view id) {
  for (const InteropSpace& known : kInteropSpaces) {
    if (known.id != id) continue;
    for (const char* name : known.names) {
      if (name == nullptr) break;
      std::string own = own_name(config, name);
      if (!own.empty()) return own;
    }
  }
  return own_name(config, std::string(id).c_str());
}

std::string names_of_spaces(const OCIO::Config& config) {
  std::vector<std::string> names;
  for (int i = 0; i < config.getNumColorSpaces(); ++i) {
    names.emplace_back(config.getColorSpaceNameByIndex(i));
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

struct ColorTransform::State {
  OCIO::ConstCPUProcessorRcPtr processor;
  bool is_linear = false, is_no_op = false;

  explicit State(OCIO::ConstCPUProcessorRcPtr of_config) : processor(std::move(of_config)) {
    is_linear = check_linear();
    is_no_op = processor->isNoOp();
  }

  std::array<float, 3> of(std::array<float, 3> rgb) const {
    processor->applyRGB(rgb.data());
    return rgb;
  }

  bool check_linear() const {
    std::array<std::array<float, 3>, 3> column{};
    for (std::size_t c = 0; c < 3; ++c) {
      std::array<float, 3> unit{};
      unit[c] = 1;
      column[c] = of(unit);
    }
    for (const std::array<float, 3>& rgb : {std::array{0.2F, 0.5F, 0.1F},
                                            {3.0F, 0.01F, 1.0F},
                                            {-0.1F, 0.4F, 8.0F},
                                            {0.0F, 0.0F, 0.0F}}) {
      const std::array<float, 3> seen = of(rgb);
      for (std::size_t c = 0; c < 3; ++c) {
        const float sum = rgb[0] * column[0][c] + rgb[1] * column[1][c] + rgb[2] * column[2][c];
        if (std::abs(sum - seen[c]) > 1e-4F * (1 + std::abs(seen[c]))) return false;
      }
    }
    return true;
  }
};

void ColorTransform::apply(std::span<float> rgba) const {
  if (state_->is_no_op || rgba.empty()) return;
  const bool divide = !state_->is_linear;
  const auto scale = [&](bool back) {
    for (std::size_t i = 0; divide && i < rgba.size(); i += 4) {
      const float alpha = rgba[i + 3];
      if (!(alpha > 0) || alpha == 1) continue;
      for (std::size_t c = 0; c < 3; ++c) rgba[i + c] *= back ? alpha : 1 / alpha;
    }
  };
  scale(false);
  OCIO::PackedImageDesc image(rgba.data(), static_cast<long>(rgba.size() / 4), 1, 4);
  state_->processor->apply(image);
  scale(true);
}

void ColorTransform::apply_rgb(std::span<float> rgb) const {
  if (state_->is_no_op || rgb.empty()) return;
  OCIO::PackedImageDesc image(rgb.data(), static_cast<long>(rgb.size() / 3), 1, 3);
  state_->processor->apply(image);
}

bool ColorTransform::is_linear() const { return state_->is_linear; }
bool ColorTransform::is_no_op() const { return state_->is_no_op; }

struct ColorConfig::State {
  OCIO::ConstConfigRcPtr config;
  std::string description, rec709;

  /// Returns the config's name of a space. Throws Error (bad input) if there is none.
  std::string known(const std::string& space) const {
    if (space == kSceneSpace) return rec709;
    std::string name = own_name(*config, space.c_str());
    if (name.empty()) name = space_by_interop_id(*config, space);
    if (!name.empty()) return name;
    throw Error::bad_input("the colour config has no space \"" + space + "\"", description,
                           "Use one of " + names_of_spaces(*config));
  }

  /// Reads the files that the config refers to.
  template <class Processor>
  std::shared_ptr<const ColorTransform::State> transform(const Processor& processor) const {
    try {
      return std::make_shared<const ColorTransform::State>(
          processor(*config)->getDefaultCPUProcessor());
    } catch (const OCIO::Exception& error) {
      throw Error::bad_input(std::string("the colour config cannot be used: ") + error.what(),
                             description, "Add the files that it refers to, or correct it");
    }
  }
};

ColorConfig ColorConfig::built_in() {
  State state{built_in_color_config(), {}, std::string(kSceneSpace)};
  state.description = fmt::format("raystage-1 built in, {}", state.config->getCacheID());
  return ColorConfig(std::make_shared<const State>(std::move(state)));
}

ColorConfig ColorConfig::from_file(const std::filesystem::path& file,
                                   const std::string& rec709_name) {
  State state;
  try {
    state.config = OCIO::Config::CreateFromFile(file.c_str());
    state.config->validate();
    state.description = fmt::format("{}, {}", file.filename().string(), state.config->getCacheID());
  } catch (const OCIO::Exception& error) {
    throw Error::bad_input(std::string("the colour config cannot be read: ") + error.what(),
                           file.string(), "Give a valid OpenColorIO config (.ocio)");
  }
  state.rec709 = rec709_name.empty() ? space_by_interop_id(*state.config, kSceneSpace)
                                     : own_name(*state.config, rec709_name.c_str());
  if (state.rec709.empty()) {
    throw Error::bad_input(
        rec709_name.empty() ? "the colour config has no space with a usual name of linear Rec.709"
                            : "the colour config has no space \"" + rec709_name + "\"",
        file.string(), "Set output.color.rec709_space to one of " + names_of_spaces(*state.config));
  }
  return ColorConfig(std::make_shared<const State>(std::move(state)));
}

const std::string& ColorConfig::description() const { return state_->description; }

ColorTransform ColorConfig::to_space(const std::string& space) const {
  const std::string name = state_->known(space);
  return ColorTransform(state_->transform([&](const auto& config) {
    return config.getProcessor(state_->rec709.c_str(), name.c_str());
  }));
}

ColorTransform ColorConfig::from_space(const std::string& space) const {
  const std::string name = state_->known(space);
  return ColorTransform(state_->transform([&](const auto& config) {
    return config.getProcessor(name.c_str(), state_->rec709.c_str());
  }));
}

ColorTransform ColorConfig::between(const std::string& from, const std::string& to) const {
  const std::string name = state_->known(from), other = state_->known(to);
  return ColorTransform(state_->transform(
      [&](const auto& config) { return config.getProcessor(name.c_str(), other.c_str()); }));
}

ColorTransform ColorConfig::to_display(const std::string& space, const std::string& display,
                                       const std::string& view) const {
  const OCIO::Config& config = *state_->config;
  const std::string of_display = display.empty() ? config.getDefaultDisplay() : display;
  const std::string through = view.empty() ? config.getDefaultView(of_display.c_str()) : view;
  std::vector<std::string> known;
  bool found = false;
  for (int i = 0; i < config.getNumDisplays(); ++i) {
    const char* name = config.getDisplay(i);
    for (int k = 0; k < config.getNumViews(name); ++k) {
      known.push_back(fmt::format("{} / {}", name, config.getView(name, k)));
      found = found || (name == of_display && config.getView(name, k) == through);
    }
  }
  if (!found) {
    throw Error::bad_input(fmt::format("the colour config has no view \"{}\" of a display \"{}\"",
                                       through, of_display),
                           state_->description,
                           fmt::format("Use one of {}", fmt::join(known, ", ")));
  }
  const std::string name = state_->known(space);
  return ColorTransform(state_->transform([&](const auto& of) {
    return of.getProcessor(name.c_str(), of_display.c_str(), through.c_str(),
                           OCIO::TRANSFORM_DIR_FORWARD);
  }));
}

std::string ColorConfig::interop_id(const std::string& space) const {
  const std::string name = own_name(*state_->config, space.c_str());
  if (!name.empty() && name == state_->rec709) return std::string(kSceneSpace);
  for (const InteropSpace& known : kInteropSpaces) {
    if (known.id == space ||
        (!name.empty() && space_by_interop_id(*state_->config, known.id) == name)) {
      return std::string(known.id);
    }
  }
  return "unknown";
}

std::string ColorConfig::space_from_interop_id(std::string_view id) const {
  return space_by_interop_id(*state_->config, id);
}

}  // namespace raystage::compose
