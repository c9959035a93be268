// SPDX-License-Identifier: Apache-2.0
// Reads PNG and JPEG images for textures without OpenImageIO, whose libraries take 0.4 s to start.
// Must give the codes that open_images.cpp gives; grey JPEG images have three equal channels.
// Damaged scans of JPEG images are errors.
#include "images/open_textures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>

#include "base/error.h"
#include "images/png_codes.h"
#include "sandbox/decoder_main.h"
#include "store/jpeg/decode.h"

namespace raystage::images {
namespace {

std::size_t bytes_of(const ImageProperties& image) {
  return image.pixels() * static_cast<std::size_t>(image.channels) * size_of(image.type);
}

/// Bytes of an image source: of the memory that was sent, or of a file that the parent opens.
std::vector<std::byte> contents_of(const ImageSource& source) {
  if (!source.format.empty()) {
    const auto bytes = std::as_bytes(std::span(source.bytes));
    return {bytes.begin(), bytes.end()};
  }
  auto bytes = sandbox::request_file(source.name);
  if (!bytes) throw std::runtime_error("it cannot be opened");
  return std::move(*bytes);
}

bool begins_with(std::span<const std::byte> bytes, std::string_view signature) {
  return bytes.size() >= signature.size() &&
         std::memcmp(bytes.data(), signature.data(), signature.size()) == 0;
}

void require_memory(const ImageProperties& image, std::size_t granted) {
  require_memory_for_pixels(image.width, image.height, image.channels, size_of(image.type),
                            granted);
}

/// Throws if a file is too short to hold all pixels: before memory is taken for them. Deflate makes
/// data at most 1032 times as large (zlib, "Technical details"), and palettes of 1 bit become 32
/// bits. JPEG stays far below that.
void require_bytes_for(const ImageProperties& image, std::size_t file_bytes) {
  constexpr std::size_t kMaxExpansion = 1032 * 32, kShortest = 100;
  if (bytes_of(image) / kMaxExpansion <= file_bytes + kShortest) return;
  throw std::runtime_error(
      fmt::format("{} x {} pixels do not fit in {} bytes", image.width, image.height, file_bytes));
}

enum class Wanted { kProperties, kCodes };

PngCodes read_png(std::span<const std::byte> bytes, std::size_t granted, Wanted wanted) {
  std::span<const std::byte> rest = bytes;
  const ReadBytes read = [&rest](std::byte* to, std::size_t count) {
    if (rest.size() < count) return false;
    std::copy_n(rest.begin(), count, to);
    rest = rest.subspan(count);
    return true;
  };
  return read_png_codes(read, [&](const ImageProperties& properties) {
    require_memory(properties, granted);
    require_bytes_for(properties, bytes.size());
    return wanted == Wanted::kCodes;
  });
}

/// An image that OpenImageIO may read.
class UnsupportedImage {};

PngCodes read_jpeg(std::span<const std::byte> bytes, std::size_t granted, Wanted wanted) {
  PngCodes image;
  try {
    const store::JpegLayout layout = store::parse_jpeg_layout(bytes, "");
    image.properties.width = image.properties.full_width = layout.width;
    image.properties.height = image.properties.full_height = layout.height;
  } catch (const Error&) {
    throw UnsupportedImage();
  }
  image.properties.channels = 3;
  require_memory(image.properties, granted);
  require_bytes_for(image.properties, bytes.size());
  if (wanted == Wanted::kProperties) return image;
  try {
    image.codes = std::move(store::JpegDecoder().decode(bytes, "").values);
  } catch (const Error& error) {
    throw std::runtime_error(error.what_happened());
  }
  return image;
}

PngCodes read_image(const ImageSource& source, Wanted wanted) {
  const std::vector<std::byte> bytes = contents_of(source);
  const auto granted = static_cast<std::size_t>(source.memory_bytes);
  if (begins_with(bytes, kPngSignature)) return read_png(bytes, granted, wanted);
  if (begins_with(bytes, kJpegSignature)) return read_jpeg(bytes, granted, wanted);
  throw std::runtime_error("it is neither PNG nor JPEG");
}

/// Converts codes of a type to floats, the largest code to 1.
template <class Code>
std::vector<std::byte> floats_from_codes(std::span<const std::byte> bytes) {
  constexpr float kScale = 1.0F / std::numeric_limits<Code>::max();  // as OpenImageIO
  std::vector<std::byte> result(bytes.size() / sizeof(Code) * sizeof(float));
  for (std::size_t i = 0; i < bytes.size() / sizeof(Code); ++i) {
    Code code = 0;
    std::memcpy(&code, bytes.data() + i * sizeof code, sizeof code);
    const float value = static_cast<float>(code) * kScale;
    std::memcpy(result.data() + i * sizeof value, &value, sizeof value);
  }
  return result;
}

}  // namespace

OpenTextures::Image& OpenTextures::image(std::uint32_t number) {
  const auto found = images_.find(number);
  if (found == images_.end()) throw std::runtime_error("it is not open");
  return found->second;
}

void OpenTextures::evict(std::size_t bytes) {
  std::size_t used = 0;
  for (const std::uint32_t number : decoded_) used += images_.at(number).codes.size();
  while (used > bytes) {
    std::vector<std::uint8_t>& codes = images_.at(decoded_.back()).codes;
    used -= codes.size();
    codes = {};
    decoded_.pop_back();
  }
}

void OpenTextures::decode(std::uint32_t number) {
  Image& wanted = image(number);
  std::erase(decoded_, number);
  if (wanted.codes.empty()) {
    std::size_t needed = bytes_of(wanted.properties);
    for (const auto& [other, opened] : images_) needed += opened.source.bytes.size();
    const std::size_t granted = 2 * static_cast<std::size_t>(wanted.source.memory_bytes);
    evict(granted - std::min(granted, needed));
    PngCodes decoded;
    try {
      decoded = read_image(wanted.source, Wanted::kCodes);
    } catch (const std::bad_alloc&) {
      evict(0);
      decoded = read_image(wanted.source, Wanted::kCodes);
    }
    if (decoded.properties != wanted.properties) throw std::runtime_error("it has changed");
    wanted.codes = std::move(decoded.codes);
  }
  decoded_.push_front(number);
}

std::vector<std::byte> OpenTextures::rows(std::uint32_t number, int begin, int end,
                                          PixelType type) {
  const ImageProperties& properties = image(number).properties;
  if (begin < properties.y || end > properties.y + properties.height || begin >= end) {
    throw std::runtime_error("it has no such rows");
  }
  decode(number);
  const std::size_t row = bytes_of(properties) / static_cast<std::size_t>(properties.height);
  const auto codes = std::as_bytes(std::span(image(number).codes))
                         .subspan(row * static_cast<std::size_t>(begin - properties.y),
                                  row * static_cast<std::size_t>(end - begin));
  if (type == properties.type) return {codes.begin(), codes.end()};
  if (type != PixelType::kFloat) throw std::runtime_error("its codes are not converted to that");
  return properties.type == PixelType::kUint16 ? floats_from_codes<std::uint16_t>(codes)
                                               : floats_from_codes<std::uint8_t>(codes);
}

std::vector<std::byte> OpenTextures::answer(std::span<const std::byte> request) {
  sandbox::ByteReader reader(request);
  sandbox::ByteWriter result;
  const auto kind = static_cast<ImageRequest>(reader.read<std::uint8_t>());
  const auto number = reader.read<std::uint32_t>();
  switch (kind) {
    case ImageRequest::kOpen: {
      ImageSource source = read_source(reader);
      try {
        const ImageProperties properties = read_image(source, Wanted::kProperties).properties;
        write_properties(result, properties);
        images_[number] = {std::move(source), properties, {}};
      } catch (const UnsupportedImage&) {
        return {};
      }
      return result.take();
    }
    case ImageRequest::kClose:
      images_.erase(number);
      std::erase(decoded_, number);
      return {};
    case ImageRequest::kLevel: {
      const int subimage = reader.read<int>(), level = reader.read<int>();
      if (subimage == 0 && level == 0) write_properties(result, image(number).properties);
      return result.take();
    }
    case ImageRequest::kRows: {
      reader.read<int>();  // subimage and level: there is one
      reader.read<int>();
      const int begin = reader.read<int>(), end = reader.read<int>();
      return rows(number, begin, end, read_pixel_type(reader));
    }
    default:
      throw std::runtime_error("it has rows and no tiles");
  }
}

}  // namespace raystage::images
