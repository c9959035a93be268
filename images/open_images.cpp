// SPDX-License-Identifier: Apache-2.0
// Reads images with OpenImageIO.
#include "images/open_images.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "images/exr_header_check.h"
#include "images/image_requests.h"

namespace raystage::images {
namespace {

PixelType type_of(const OIIO::ImageSpec& spec) {
  switch (spec.format.basetype) {
    case OIIO::TypeDesc::UINT8:
      return PixelType::kUint8;
    case OIIO::TypeDesc::UINT16:
      return PixelType::kUint16;
    case OIIO::TypeDesc::HALF:
      return PixelType::kHalf;
    default:
      return PixelType::kFloat;
  }
}

OIIO::TypeDesc oiio_type(PixelType type) {
  constexpr std::array kTypes{OIIO::TypeDesc::UINT8, OIIO::TypeDesc::UINT16, OIIO::TypeDesc::HALF,
                              OIIO::TypeDesc::FLOAT};
  return kTypes.at(static_cast<std::size_t>(type));
}

/// Returns the channel of alpha, or -1. OpenImageIO's GIF reader states one beyond the last.
int alpha_channel_of(const OIIO::ImageSpec& spec) {
  if (spec.alpha_channel < spec.nchannels) return spec.alpha_channel;
  return spec.channelindex("A");
}

ImageProperties properties_of(const OIIO::ImageSpec& spec) {
  return {.x = spec.x,
          .y = spec.y,
          .width = spec.width,
          .height = spec.height,
          .full_x = spec.full_x,
          .full_y = spec.full_y,
          .full_width = spec.full_width,
          .full_height = spec.full_height,
          .tile_width = spec.tile_width,
          .tile_height = spec.tile_height,
          .channels = spec.nchannels,
          .alpha_channel = alpha_channel_of(spec),
          .type = type_of(spec)};
}

std::size_t size_of_pixels(const OIIO::ImageSpec& spec, int width, int height, PixelType type) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
         static_cast<std::size_t>(spec.nchannels) * size_of(type);
}

std::runtime_error oiio_error(const OIIO::ImageInput& input) {
  return std::runtime_error("it is damaged: " + input.geterror());
}

}  // namespace

class OpenImages::Image {
 public:
  enum class Alpha { kApplied, kAsInFile };  ///< to colours

  Image(ImageSource source, Alpha alpha) : source_(std::move(source)) {
    OIIO::ImageSpec config;
    if (alpha == Alpha::kAsInFile) config.attribute("oiio:UnassociatedAlpha", 1);
    std::string name = source_.name;
    if (!source_.format.empty()) {
      memory_.emplace(source_.bytes.data(), source_.bytes.size());
      OIIO::Filesystem::IOProxy* proxy = &*memory_;
      config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, static_cast<void*>(&proxy));
      // OpenImageIO chooses a reader by the extension. A file of this name cannot exist.
      name = "/proc/self/embedded/image." + source_.format;
    } else {
      require_plausible_exr_header(name);  // whatever its extension is
    }
    input_ = OIIO::ImageInput::open(name, &config);
    if (!input_) throw std::runtime_error(OIIO::geterror());
  }

  /// Throws if all pixels as values of a type need more memory than is granted.
  void require_memory_for_all(PixelType type) {
    const OIIO::ImageSpec spec = required_level(0, 0);
    require_memory(spec, spec.width, spec.height, size_of(type));
  }
  /// The same for what reading a part of a level needs: a tile, or else all pixels as they are in
  /// the file, because readers may decode it as a whole.
  void require_memory_for_parts(const OIIO::ImageSpec& spec) const {
    if (spec.tile_width > 0) {
      require_memory(spec, spec.tile_width, spec.tile_height, sizeof(float));
    } else {
      require_memory(spec, spec.width, spec.height, spec.format.size());
    }
  }

  std::optional<OIIO::ImageSpec> level(int subimage, int miplevel) {
    if (!input_->seek_subimage(subimage, miplevel)) return std::nullopt;
    return input_->spec();
  }
  OIIO::ImageSpec required_level(int subimage, int miplevel) {
    const auto spec = level(subimage, miplevel);
    if (!spec) throw std::runtime_error("it has no such level");
    return *spec;
  }
  std::vector<std::byte> rows(int subimage, int miplevel, int begin, int end, PixelType type) {
    const OIIO::ImageSpec spec = required_level(subimage, miplevel);
    if (begin < spec.y || end > spec.y + spec.height || begin >= end) {
      throw std::runtime_error("it has no such rows");
    }
    if (spec.tile_width > 0) return rows_of_tiles(spec, subimage, miplevel, begin, end, type);
    std::vector<std::byte> pixels(size_of_pixels(spec, spec.width, end - begin, type));
    if (!input_->read_scanlines(subimage, miplevel, begin, end, 0, 0, spec.nchannels,
                                oiio_type(type), pixels.data())) {
      throw oiio_error(*input_);
    }
    return pixels;
  }
  std::vector<std::byte> tile(int subimage, int miplevel, int x, int y, PixelType type) {
    const OIIO::ImageSpec spec = required_level(subimage, miplevel);
    if (spec.tile_width <= 0) throw std::runtime_error("it has no tiles");
    std::vector<std::byte> pixels(size_of_pixels(spec, spec.tile_width, spec.tile_height, type));
    // Checks whether there is such a tile.
    if (!input_->read_tiles(subimage, miplevel, x, x + spec.tile_width, y, y + spec.tile_height, 0,
                            1, 0, spec.nchannels, oiio_type(type), pixels.data())) {
      throw oiio_error(*input_);
    }
    return pixels;
  }

 private:
  void require_memory(const OIIO::ImageSpec& spec, int width, int height,
                      std::size_t value_bytes) const {
    require_memory_for_pixels(width, height, spec.nchannels, value_bytes, source_.memory_bytes);
  }
  std::vector<std::byte> rows_of_tiles(const OIIO::ImageSpec& spec, int subimage, int miplevel,
                                       int begin, int end, PixelType type) {
    const int above = (begin - spec.y) % spec.tile_height;
    const int first = begin - above;
    const int tiles = (end - first + spec.tile_height - 1) / spec.tile_height;
    const int last = std::min(first + tiles * spec.tile_height, spec.y + spec.height);
    std::vector<std::byte> pixels(size_of_pixels(spec, spec.width, last - first, type));
    if (!input_->read_tiles(subimage, miplevel, spec.x, spec.x + spec.width, first, last, 0, 1, 0,
                            spec.nchannels, oiio_type(type), pixels.data())) {
      throw oiio_error(*input_);
    }
    const auto skipped = static_cast<std::ptrdiff_t>(size_of_pixels(spec, spec.width, above, type));
    pixels.erase(pixels.begin(), pixels.begin() + skipped);
    pixels.resize(size_of_pixels(spec, spec.width, end - begin, type));
    return pixels;
  }

  ImageSource source_;
  std::optional<OIIO::Filesystem::IOMemReader> memory_;  // before the reader that uses it
  std::unique_ptr<OIIO::ImageInput> input_;
};

OpenImages::OpenImages() {
  // No process may be started here, nor a thread.
  OIIO::attribute("threads", 1);
  OIIO::attribute("exr_threads", -1);
}
OpenImages::~OpenImages() = default;

OpenImages::Image& OpenImages::image(std::uint32_t number) const {
  const auto found = images_.find(number);
  if (found == images_.end()) throw std::runtime_error("it is not open");
  return *found->second;
}

std::vector<std::byte> OpenImages::answer(std::span<const std::byte> request) {
  sandbox::ByteReader reader(request);
  sandbox::ByteWriter result;
  const auto kind = static_cast<ImageRequest>(reader.read<std::uint8_t>());
  if (kind == ImageRequest::kProperties || kind == ImageRequest::kRead) {
    Image image(read_source(reader), Image::Alpha::kApplied);
    const ImageProperties properties = properties_of(image.required_level(0, 0));
    write_properties(result, properties);
    if (kind == ImageRequest::kProperties) return result.take();
    const PixelType type = read_pixel_type(reader);
    image.require_memory_for_all(type);
    result.append(image.rows(0, 0, properties.y, properties.y + properties.height, type));
    return result.take();
  }
  const auto number = reader.read<std::uint32_t>();
  if (kind == ImageRequest::kOpen) {
    auto image = std::make_unique<Image>(read_source(reader), Image::Alpha::kAsInFile);
    const OIIO::ImageSpec spec = image->required_level(0, 0);
    image->require_memory_for_parts(spec);
    write_properties(result, properties_of(spec));
    images_[number] = std::move(image);
    return result.take();
  }
  if (kind == ImageRequest::kClose) {
    images_.erase(number);
    return {};
  }
  Image& asked = image(number);
  const int subimage = reader.read<int>(), level = reader.read<int>();
  if (kind == ImageRequest::kLevel) {
    if (const auto spec = asked.level(subimage, level)) {
      asked.require_memory_for_parts(*spec);
      write_properties(result, properties_of(*spec));
    }
    return result.take();
  }
  const int first = reader.read<int>(), second = reader.read<int>();
  const PixelType type = read_pixel_type(reader);
  return kind == ImageRequest::kRows ? asked.rows(subimage, level, first, second, type)
                                     : asked.tile(subimage, level, first, second, type);
}

}  // namespace raystage::images
