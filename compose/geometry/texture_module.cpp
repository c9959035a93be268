// SPDX-License-Identifier: Apache-2.0
// Looks up textures by OpenImageIO's texture system: bilinear within a MIP level, filtered over the
// requested width. Files of integers are read as linear light. Environment images are latitude by
// longitude. Near the poles the filter is widened along the longitude by 1 / cos(latitude). Output:
// linear R, G, B in the file's primaries. Cost: constant per lookup, plus the tiles that are not
// cached.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/transfer_function.h"
#include "compose/geometry/texture_lookup.h"

namespace raystage::compose {
namespace {

using Wrap = OIIO::TextureOpt::Wrap;

struct Texture {
  std::string name;  ///< path of a file, or name of an image in memory
  OIIO::TextureSystem::TextureHandle* handle = nullptr;
};

bool is_integer(const OIIO::ImageSpec& spec) {
  return spec.format == OIIO::TypeDesc::UINT8 || spec.format == OIIO::TypeDesc::UINT16;
}

constexpr const char* kBytes = "raystage:bytes";  // pointer to the std::string_view of an image

/// Reads an image as linear light, so that OpenImageIO filters linear values: integers as sRGB
/// codes, floats as they are. Alpha is not applied to colours. Its name is that of the file with
/// kMarker; images in memory are given by the attribute kBytes of the configuration.
class LinearSrgbInput final : public OIIO::ImageInput {
 public:
  static constexpr std::string_view kMarker = ".codes";
  static OIIO::ImageInput* create() { return new LinearSrgbInput; }

  const char* format_name() const override { return "light of codes"; }
  bool open(const std::string& name, OIIO::ImageSpec& spec) override {
    return open(name, spec, OIIO::ImageSpec());
  }
  bool open(const std::string& name, OIIO::ImageSpec& spec,
            const OIIO::ImageSpec& config) override {
    OIIO::ImageSpec of_codes;
    of_codes.attribute("oiio:UnassociatedAlpha", 1);
    if (const auto* bytes = static_cast<const std::string_view*>(bytes_of(config))) {
      // One reader for each open image: it has a position.
      memory_.emplace(bytes->data(), bytes->size());
      OIIO::Filesystem::IOProxy* proxy = &*memory_;
      of_codes.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, static_cast<void*>(&proxy));
    }
    codes_ = OIIO::ImageInput::open(name.substr(0, name.size() - kMarker.size()), &of_codes);
    if (!codes_) return false;
    m_spec = codes_->spec();
    is_tiled_ = m_spec.tile_width > 0;
    holds_codes_ = is_integer(m_spec);
    m_spec.set_format(OIIO::TypeDesc::FLOAT);
    m_spec.tile_width = m_spec.tile_height = m_spec.tile_depth = 0;
    spec = m_spec;
    return true;
  }
  bool close() override { return !codes_ || codes_->close(); }
  int current_subimage() const override { return 0; }
  int current_miplevel() const override { return 0; }
  bool seek_subimage(int subimage, int miplevel) override { return subimage == 0 && miplevel == 0; }
  bool read_native_scanline(int subimage, int miplevel, int y, int z, void* data) override {
    if (!seek_subimage(subimage, miplevel)) return false;
    const std::lock_guard<ImageInput> lock(*this);
    auto* light = static_cast<float*>(data);
    const auto channels = static_cast<std::size_t>(m_spec.nchannels);
    const std::size_t row = static_cast<std::size_t>(m_spec.width) * channels;
    if (!is_tiled_) {
      if (!codes_->read_scanline(y, z, OIIO::TypeDesc::FLOAT, light)) return false;
    } else {
      // A tiled file has no rows: read all of it at once.
      if (all_.empty()) {
        all_.resize(row * static_cast<std::size_t>(m_spec.height));
        if (!codes_->read_image(0, 0, 0, m_spec.nchannels, OIIO::TypeDesc::FLOAT, all_.data()))
          return false;
      }
      const auto first = static_cast<std::ptrdiff_t>(row) * (y - m_spec.y);
      std::copy_n(all_.begin() + first, row, light);
    }
    for (std::size_t i = 0; holds_codes_ && i < row; ++i) {
      if (static_cast<int>(i % channels) == m_spec.alpha_channel) continue;
      light[i] = static_cast<float>(linear_from_srgb(double{light[i]}));
    }
    return true;
  }

 private:
  static const void* bytes_of(const OIIO::ImageSpec& config) {
    const OIIO::ParamValue* value = config.find_attribute(kBytes, OIIO::TypeDesc::PTR);
    return value == nullptr ? nullptr : *static_cast<const void* const*>(value->data());
  }

  std::optional<OIIO::Filesystem::IOMemReader> memory_;  // before the reader that uses it
  std::unique_ptr<OIIO::ImageInput> codes_;
  bool is_tiled_ = false, holds_codes_ = true;
  std::vector<float> all_;  // pixels of a tiled file
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
    if (const Texture* texture = find(file.string())) return texture;
    OIIO::ustring name(file.string());
    OIIO::ImageSpec spec;
    if (!system_->get_imagespec(name, 0, spec)) {
      throw Error::bad_input("the texture cannot be read: " + system_->geterror(), file.string(),
                             "Use an image that OpenImageIO reads: EXR, PNG, TIFF ...");
    }
    if (is_integer(spec)) {
      name = OIIO::ustring(file.string() + std::string(LinearSrgbInput::kMarker));
      system_->imagecache()->add_file(name, LinearSrgbInput::create, nullptr);
    }
    return add(file.string(), name);
  }

  Handle open_bytes(const std::string& name, const std::string& format,
                    std::string_view bytes) override {
    if (const Texture* texture = find(name)) return texture;
    images_.push_back(bytes);
    const std::string_view* image = &images_.back();
    OIIO::ImageSpec config;
    config.attribute(kBytes, OIIO::TypeDesc::PTR, static_cast<const void*>(&image));
    // OpenImageIO chooses a reader by the extension. A file of this name cannot exist.
    const OIIO::ustring marked(fmt::format("/proc/self/embedded/{}.{}{}", images_.size(), format,
                                           LinearSrgbInput::kMarker));
    OIIO::ImageSpec spec;
    if (!LinearSrgbInput().open(marked.string(), spec, config)) {
      throw Error::bad_input("the texture in the mesh file cannot be read: " + OIIO::geterror(),
                             name, "Export it again, as PNG or JPEG");
    }
    system_->imagecache()->add_file(marked, LinearSrgbInput::create, &config);
    return add(name, marked);
  }

  Eigen::Vector3f color(Handle texture, float u, float v, float width) const override {
    return look_up(*static_cast<const Texture*>(texture), u, v, width, width, Wrap::WrapPeriodic);
  }

  Eigen::Vector3f environment_color(Handle texture, const Eigen::Vector3d& direction,
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
    // Rows of an image are top-down.
    system_->texture(texture.handle, nullptr, options, u, 1 - v, du, 0, 0, dv, 3, rgb);
    return {rgb[0], rgb[1], rgb[2]};
  }

  const Texture* find(std::string_view name) const {
    const auto found = std::ranges::find(opened_, name, &Texture::name);
    return found == opened_.end() ? nullptr : &*found;
  }
  const Texture* add(std::string name, const OIIO::ustring& in_system) {
    opened_.push_back({std::move(name), system_->get_texture_handle(in_system)});
    return &opened_.back();
  }

  std::deque<std::string_view> images_;  // before the system, which reads them
  std::unique_ptr<OIIO::TextureSystem, Release> system_;
  std::deque<Texture> opened_;  // a deque keeps the addresses of handles
};

}  // namespace
}  // namespace raystage::compose

extern "C" __attribute__((visibility("default"))) raystage::compose::TextureLookup*
raystage_open_texture_lookup_2(std::size_t cache_bytes) {
  return new raystage::compose::OiioTextureLookup(cache_bytes);
}
