// SPDX-License-Identifier: Apache-2.0
#include <OpenImageIO/texture.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <numbers>

#include "compose/geometry/texture_lookup.h"
#include "schemas/error.h"
#include "schemas/transfer_function.h"

namespace raystage {
namespace {

using Wrap = OIIO::TextureOpt::Wrap;

struct Texture {
  OIIO::ustring name;
  OIIO::TextureSystem::TextureHandle* handle = nullptr;
  bool is_srgb = false;
};

class OiioTextureLookup : public TextureLookup {
 public:
  explicit OiioTextureLookup(std::size_t cache_bytes)
      : system_(OIIO::TextureSystem::create(false)) {
    constexpr double kBytesPerMegabyte = 1 << 20;
    system_->attribute("max_memory_MB",
                       static_cast<float>(static_cast<double>(cache_bytes) / kBytesPerMegabyte));
    system_->attribute("autotile", 64);
    system_->attribute("automip", 1);
    system_->attribute("gray_to_rgb", 1);
  }

  Handle open(const std::filesystem::path& file) override {
    const OIIO::ustring name(file.string());
    for (const Texture& texture : opened_) {
      if (texture.name == name) return &texture;
    }
    OIIO::ImageSpec spec;
    if (!system_->get_imagespec(name, 0, spec)) {
      throw Error::bad_input("the texture cannot be read: " + system_->geterror(), file.string(),
                             "Use an image that OpenImageIO reads: EXR, PNG, TIFF ...");
    }
    const bool is_integer =
        spec.format == OIIO::TypeDesc::UINT8 || spec.format == OIIO::TypeDesc::UINT16;
    opened_.push_back({name, system_->get_texture_handle(name), is_integer});
    return &opened_.back();
  }

  Eigen::Vector3f color(Handle texture, float u, float v, float width) const override {
    return look_up(*static_cast<const Texture*>(texture), u, v, width, width, Wrap::WrapPeriodic);
  }

  Eigen::Vector3f around(Handle texture, const Eigen::Vector3d& direction,
                         float width) const override {
    constexpr double kTurn = 2 * std::numbers::pi;
    const double longitude = std::atan2(direction.x(), -direction.z());
    const double latitude = std::asin(std::clamp(direction.y(), -1.0, 1.0));
    const double along = std::max(std::cos(latitude), 1e-3);
    return look_up(*static_cast<const Texture*>(texture),
                   static_cast<float>(0.5 + longitude / kTurn),
                   static_cast<float>(0.5 + 2 * latitude / kTurn),
                   static_cast<float>(std::min(double{width} / kTurn / along, 1.0)),
                   static_cast<float>(std::min(2 * double{width} / kTurn, 1.0)), Wrap::WrapClamp);
  }

 private:
  struct Release {
    void operator()(OIIO::TextureSystem* system) const { OIIO::TextureSystem::destroy(system); }
  };

  Eigen::Vector3f look_up(const Texture& texture, float u, float v, float du, float dv,
                          Wrap up_and_down) const {
    OIIO::TextureOpt options;
    options.interpmode = OIIO::TextureOpt::InterpBilinear;  // bicubic would soften close-ups
    options.swrap = Wrap::WrapPeriodic;
    options.twrap = up_and_down;
    float rgb[3] = {};
    // Rows of a picture run downwards.
    system_->texture(texture.handle, nullptr, options, u, 1 - v, du, 0, 0, dv, 3, rgb);
    Eigen::Vector3f color(rgb[0], rgb[1], rgb[2]);
    if (!texture.is_srgb) return color;
    for (float& c : color) c = static_cast<float>(linear_from_srgb(double{c}));
    return color;
  }

  std::unique_ptr<OIIO::TextureSystem, Release> system_;
  std::deque<Texture> opened_;  // handles stay where they are
};

}  // namespace
}  // namespace raystage

extern "C" __attribute__((visibility("default"))) raystage::TextureLookup*
raystage_open_texture_lookup(std::size_t cache_bytes) {
  return new raystage::OiioTextureLookup(cache_bytes);
}
