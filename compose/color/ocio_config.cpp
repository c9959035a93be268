// SPDX-License-Identifier: Apache-2.0
// Wraps OpenColorIO. A transform counts as linear if it maps some test colours as the matrix of its
// responses to the three unit colours does, up to 1e-4. Others are applied to colours that are
// divided by alpha. Spaces are found by name, alias, role or ASWF's ColorInterop id. Cost: linear
// in pixels.
#include "compose/color/ocio_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "compose/color/built_in_config.h"
#include "compose/color/scene_space.h"

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

OcioTransform::OcioTransform(OCIO::ConstCPUProcessorRcPtr processor)
    : processor_(std::move(processor)), is_no_op_(processor_->isNoOp()) {
  measure();
}

void OcioTransform::measure() {
  const auto of = [this](std::array<float, 3> rgb) {
    processor_->applyRGB(rgb.data());
    return rgb;
  };
  for (std::size_t c = 0; c < 3; ++c) {
    std::array<float, 3> unit{};
    unit[c] = 1;
    columns_[c] = of(unit);
  }
  float deviation = 0;
  for (const std::array<float, 3>& rgb : {std::array{0.2F, 0.5F, 0.1F},
                                          {3.0F, 0.01F, 1.0F},
                                          {-0.1F, 0.4F, 8.0F},
                                          {0.3F, -2.0F, 0.1F},
                                          {0.2F, 0.7F, -50.0F},
                                          {6e4F, 1.0F, 3.0F},
                                          {2.0F, 6e4F, 1.0F},
                                          {1.0F, 5.0F, 6e4F},
                                          {0.0F, 0.0F, 0.0F}}) {
    const std::array<float, 3> seen = of(rgb);
    for (std::size_t c = 0; c < 3; ++c) {
      const float sum = rgb[0] * columns_[0][c] + rgb[1] * columns_[1][c] + rgb[2] * columns_[2][c];
      const float difference = std::abs(sum - seen[c]) / (1 + std::abs(seen[c]));
      deviation = std::max(deviation, std::isfinite(difference) ? difference : 1);
    }
  }
  constexpr float kLinear = 1e-4F, kMatrix = 2e-6F;
  is_linear_ = deviation <= kLinear;
  is_matrix_ = deviation <= kMatrix;
}

void OcioTransform::apply(std::span<float> values, int channels) const {
  if (values.empty()) return;
  OCIO::PackedImageDesc image(values.data(),
                              static_cast<long>(values.size() / static_cast<std::size_t>(channels)),
                              1, channels);
  processor_->apply(image);
}

struct OcioConfig::State {
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
  OcioTransform transform(const Processor& processor) const {
    try {
      return OcioTransform(processor(*config)->getDefaultCPUProcessor());
    } catch (const OCIO::Exception& error) {
      throw Error::bad_input(std::string("the colour config cannot be used: ") + error.what(),
                             description, "Add the files that it refers to, or correct it");
    }
  }
};

OcioConfig OcioConfig::built_in() {
  State state{built_in_color_config(), {}, std::string(kSceneSpace)};
  state.description = fmt::format("raystage-1 built in, {}", state.config->getCacheID());
  return OcioConfig(std::make_shared<const State>(std::move(state)));
}

OcioConfig OcioConfig::from_file(const std::filesystem::path& file,
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
  return OcioConfig(std::make_shared<const State>(std::move(state)));
}

const std::string& OcioConfig::description() const { return state_->description; }

OcioTransform OcioConfig::to_space(const std::string& space) const {
  const std::string name = state_->known(space);
  return state_->transform([&](const auto& config) {
    return config.getProcessor(state_->rec709.c_str(), name.c_str());
  });
}

OcioTransform OcioConfig::from_space(const std::string& space) const {
  const std::string name = state_->known(space);
  return state_->transform([&](const auto& config) {
    return config.getProcessor(name.c_str(), state_->rec709.c_str());
  });
}

OcioTransform OcioConfig::between(const std::string& from, const std::string& to) const {
  const std::string name = state_->known(from), other = state_->known(to);
  return state_->transform(
      [&](const auto& config) { return config.getProcessor(name.c_str(), other.c_str()); });
}

OcioTransform OcioConfig::to_display(const std::string& space, const std::string& display,
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
  return state_->transform([&](const auto& of) {
    return of.getProcessor(name.c_str(), of_display.c_str(), through.c_str(),
                           OCIO::TRANSFORM_DIR_FORWARD);
  });
}

std::string OcioConfig::interop_id(const std::string& space) const {
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

std::string OcioConfig::space_from_interop_id(std::string_view id) const {
  return space_by_interop_id(*state_->config, id);
}

}  // namespace raystage::compose
