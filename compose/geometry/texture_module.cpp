// SPDX-License-Identifier: Apache-2.0
// Looks up textures by OpenImageIO's texture system: bilinear within a MIP level, filtered over the
// requested width. Files of integers are read as linear light. Environment images are latitude by
// longitude. Near the poles the filter is widened along the longitude by 1 / cos(latitude). Output:
// linear R, G, B in the file's primaries. Files are decoded by a confined process. Cost: constant
// per lookup, plus the tiles that are not cached.
#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <mutex>
#include <new>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/transfer_function.h"
#include "compose/geometry/texture_lookup.h"
#include "images/image_session.h"

namespace raystage::compose {
namespace {

using Wrap = OIIO::TextureOpt::Wrap;

struct Texture {
  images::ImageSession* session = nullptr;
  std::string name;                  ///< of the file, or of the image in memory
  std::string format;                ///< of the image in memory; empty: a file
  std::string_view bytes;            ///< of the image in memory
  sandbox::OpenFile open_file = {};  ///< of a file
  bool holds_codes = false;          ///< integers: sRGB codes
  OIIO::TextureSystem::TextureHandle* handle = nullptr;

  images::ImageSession::Image open() const {
    return format.empty() ? session->open(name, open_file)
                          : session->open_bytes(name, format, bytes);
  }
};

OIIO::TypeDesc oiio_type(images::PixelType type) {
  constexpr std::array kTypes{OIIO::TypeDesc::UINT8, OIIO::TypeDesc::UINT16, OIIO::TypeDesc::HALF,
                              OIIO::TypeDesc::FLOAT};
  return kTypes.at(static_cast<std::size_t>(type));
}

/// OpenImageIO appends a line for each attempt.
std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

constexpr const char* kTexture = "raystage:texture";  // attribute: pointer to a Texture

/// Gives OpenImageIO the pixels that a confined process decodes, as linear light, so that linear
/// values are filtered: integers are sRGB codes, whose file is taken as one of rows without levels.
/// Alpha is not applied to colours.
class DecodedInput final : public OIIO::ImageInput {
 public:
  static OIIO::ImageInput* create() { return new DecodedInput; }
  ~DecodedInput() override { close(); }

  const char* format_name() const override { return "decoded"; }
  bool open(const std::string& /*name*/, OIIO::ImageSpec& /*spec*/) override { return false; }
  bool open(const std::string& /*name*/, OIIO::ImageSpec& spec,
            const OIIO::ImageSpec& config) override {
    const OIIO::ParamValue* value = config.find_attribute(kTexture, OIIO::TypeDesc::PTR);
    if (value == nullptr) return false;
    texture_ = *static_cast<const Texture* const*>(value->data());
    return guarded([&] {
      image_ = texture_->open();
      set_level(0, 0, image_->properties);
      spec = m_spec;
      return true;
    });
  }
  bool close() override {
    if (image_) guarded([&] { return texture_->session->close(*image_), true; });
    image_.reset();
    return true;
  }
  int current_subimage() const override { return subimage_; }
  int current_miplevel() const override { return level_; }
  bool seek_subimage(int subimage, int miplevel) override {
    if (subimage == subimage_ && miplevel == level_) return true;
    if (subimage != 0 || miplevel < 0 || texture_->holds_codes) return false;
    return guarded([&] {
      const auto properties = texture_->session->level(*image_, subimage, miplevel);
      if (properties) set_level(subimage, miplevel, *properties);
      return properties.has_value();
    });
  }
  bool read_native_scanline(int subimage, int miplevel, int y, int z, void* data) override {
    return read_native_scanlines(subimage, miplevel, y, y + 1, z, data);
  }
  bool read_native_scanlines(int subimage, int miplevel, int begin, int end, int /*z*/,
                             void* data) override {
    const std::lock_guard<ImageInput> lock(*this);
    if (!seek_subimage(subimage, miplevel)) return false;
    end = std::min(end, m_spec.y + m_spec.height);
    const auto rows = static_cast<std::size_t>(end - begin);
    const std::span<std::byte> pixels(static_cast<std::byte*>(data),
                                      rows * m_spec.scanline_bytes(true));
    return guarded([&] {
      texture_->session->read_rows(*image_, subimage, miplevel, begin, end, type_, pixels);
      if (texture_->holds_codes) convert_codes(static_cast<float*>(data), rows);
      return true;
    });
  }
  bool read_native_tile(int subimage, int miplevel, int x, int y, int /*z*/, void* data) override {
    const std::lock_guard<ImageInput> lock(*this);
    if (!seek_subimage(subimage, miplevel)) return false;
    const std::span<std::byte> pixels(static_cast<std::byte*>(data), m_spec.tile_bytes(true));
    return guarded([&] {
      texture_->session->read_tile(*image_, subimage, miplevel, x, y, type_, pixels);
      return true;
    });
  }

 private:
  /// Returns what the function returns; an Error becomes OpenImageIO's.
  template <class Function>
  bool guarded(const Function& function) {
    try {
      return function();
    } catch (const Error& error) {
      errorfmt("{}", error.what());
      return false;
    } catch (const std::bad_alloc&) {
      errorfmt("{} needs more memory than there is", texture_->name);
      return false;
    }
  }
  void set_level(int subimage, int miplevel, const images::ImageProperties& level) {
    subimage_ = subimage;
    level_ = miplevel;
    type_ = texture_->holds_codes ? images::PixelType::kFloat : level.type;
    m_spec = OIIO::ImageSpec(level.width, level.height, level.channels, oiio_type(type_));
    m_spec.x = level.x;
    m_spec.y = level.y;
    m_spec.full_x = level.full_x;
    m_spec.full_y = level.full_y;
    m_spec.full_width = level.full_width;
    m_spec.full_height = level.full_height;
    m_spec.alpha_channel = level.alpha_channel;
    if (texture_->holds_codes) return;
    m_spec.tile_width = level.tile_width;
    m_spec.tile_height = level.tile_height;
    m_spec.tile_depth = 1;
  }
  void convert_codes(float* light, std::size_t rows) const {
    const auto channels = static_cast<std::size_t>(m_spec.nchannels);
    const std::size_t values = rows * static_cast<std::size_t>(m_spec.width) * channels;
    for (std::size_t i = 0; i < values; ++i) {
      if (static_cast<int>(i % channels) == m_spec.alpha_channel) continue;
      light[i] = static_cast<float>(linear_from_srgb(double{light[i]}));
    }
  }

  const Texture* texture_ = nullptr;
  std::optional<images::ImageSession::Image> image_;
  int subimage_ = 0, level_ = 0;
  images::PixelType type_ = images::PixelType::kFloat;
};

class OiioTextureLookup : public TextureLookup {
 public:
  OiioTextureLookup(images::ImageSession& session, std::size_t cache_bytes)
      : session_(session), system_(OIIO::TextureSystem::create(false)) {
    constexpr double kBytesPerMegabyte = 1 << 20;
    system_->attribute("max_memory_MB",
                       static_cast<float>(static_cast<double>(cache_bytes) / kBytesPerMegabyte));
    // Readers may hold whole pictures of files that are open.
    system_->attribute("max_open_files", 16);
    system_->attribute("autotile", 64);
    system_->attribute("automip", 1);
    system_->attribute("gray_to_rgb", 1);
  }

  Handle open(const std::string& name, const sandbox::OpenFile& open_file) override {
    if (const Texture* texture = find(name)) return texture;
    return add(
        {.session = &session_, .name = name, .format = {}, .bytes = {}, .open_file = open_file});
  }

  Handle open_bytes(const std::string& name, const std::string& format,
                    std::string_view bytes) override {
    if (const Texture* texture = find(name)) return texture;
    return add({.session = &session_, .name = name, .format = format, .bytes = bytes});
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
    if (!system_->texture(texture.handle, nullptr, options, u, 1 - v, du, 0, 0, dv, 3, rgb)) {
      const std::string reason = system_->geterror();
      throw Error::bad_input(
          "the texture cannot be read" + (reason.empty() ? "" : ": " + first_line(reason)),
          texture.name, "Save it again");
    }
    return {rgb[0], rgb[1], rgb[2]};
  }

  const Texture* find(std::string_view name) const {
    const auto found = std::ranges::find(textures_, name, &Texture::name);
    return found == textures_.end() ? nullptr : &*found;
  }
  const Texture* add(Texture opened) {
    const images::ImageSession::Image image = opened.open();
    opened.holds_codes = image.properties.holds_integers();
    session_.close(image);
    textures_.push_back(std::move(opened));
    Texture* const texture = &textures_.back();
    OIIO::ImageSpec config;
    config.attribute(kTexture, OIIO::TypeDesc::PTR, static_cast<const void*>(&texture));
    // A name of its own: no file is opened by it.
    const OIIO::ustring name(fmt::format("texture {}", textures_.size()));
    system_->imagecache()->add_file(name, DecodedInput::create, &config);
    texture->handle = system_->get_texture_handle(name);
    return texture;
  }

  images::ImageSession& session_;
  std::deque<Texture> textures_;  // before the system, which reads them; keeps its addresses
  std::unique_ptr<OIIO::TextureSystem, Release> system_;
};

}  // namespace
}  // namespace raystage::compose

extern "C" __attribute__((visibility("default"))) raystage::compose::TextureLookup*
raystage_open_texture_lookup_4(raystage::images::ImageSession& session, std::size_t cache_bytes) {
  return new raystage::compose::OiioTextureLookup(session, cache_bytes);
}
