// SPDX-License-Identifier: Apache-2.0
#include "images/image_session.h"

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "base/error.h"
#include "base/posix_file.h"
#include "images/image_decoder_options.h"
#include "images/image_requests.h"

namespace raystage::images {
namespace {

constexpr std::size_t kSmallest = std::size_t{16} << 20;  // always granted, bytes

sandbox::DecoderOptions texture_decoder_options(std::size_t memory_bytes) {
  sandbox::DecoderOptions options = image_decoder_options("texture", memory_bytes);
  options.program = "raystage-decode-texture";
  return options;
}

/// Returns the first bytes of a file, enough for its signature; fewer if it cannot be read.
std::string first_bytes(const std::string& name, const sandbox::OpenFile& open_file) {
  std::string bytes(kPngSignature.size(), '\0');
  const FileDescriptor file = open_file(name);
  const ssize_t got = file.open() ? ::pread(file.number(), bytes.data(), bytes.size(), 0) : 0;
  bytes.resize(static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  return bytes;
}

/// Returns which decoder opens an image first. `bytes`: its first ones.
ImageSession::Decoder decoder_of(std::string_view bytes) {
  const bool is_common = bytes.starts_with(kPngSignature) || bytes.starts_with(kJpegSignature);
  return is_common ? ImageSession::Decoder::kPngAndJpeg : ImageSession::Decoder::kAllFormats;
}

FileDescriptor no_file(const std::string& /*name*/) { return FileDescriptor(-1); }

Error damaged(const std::runtime_error& error, const std::string& name) {
  return Error::bad_input(std::string("the texture cannot be read: ") + error.what(), name,
                          "Save it again");
}

}  // namespace

struct ImageSession::Part {
  ImageRequest request;
  int subimage, level, first, second;
  PixelType type;
};

/// What is opened: a file, or an image in memory.
struct ImageSession::Source {
  std::string name;
  std::string format;      ///< of the image in memory; empty: a file
  std::string_view bytes;  ///< of the image in memory, or the first ones of the file
  sandbox::OpenFile open_file;
};

ImageSession::ImageSession(std::size_t memory_bytes)
    : memory_bytes_(memory_bytes),
      png_and_jpeg_{{}, sandbox::DecoderProcess(texture_decoder_options(memory_bytes))},
      all_formats_{{}, sandbox::DecoderProcess(image_decoder_options("texture", memory_bytes))} {}

void ImageSession::start_for(const std::string& name, const sandbox::OpenFile& open_file) {
  start_for_bytes(first_bytes(name, open_file));
}

void ImageSession::start_for_bytes(std::string_view bytes) {
  Process& started = process(decoder_of(bytes));
  const std::lock_guard lock(started.mutex);
  started.decoder.start();
}

std::vector<std::byte> ImageSession::decode(Decoder decoder, std::span<const std::byte> request,
                                            const std::string& name,
                                            const sandbox::OpenFile& open_file) {
  Process& asked = process(decoder);
  const std::lock_guard lock(asked.mutex);
  return asked.decoder.decode(request, name, open_file);
}

std::optional<ImageSession::Image> ImageSession::open_by(Decoder decoder, const Source& source) {
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(ImageRequest::kOpen));
  // Given here: a process that replaces a crashed one knows none of the earlier numbers.
  const std::uint32_t number = next_number_++;
  request.write(number);
  const bool is_file = source.format.empty();
  write_source(request, {source.name, source.format, is_file ? "" : std::string(source.bytes),
                         memory_bytes_});
  const auto result = decode(decoder, request.take(), source.name, source.open_file);
  if (result.empty() && decoder == Decoder::kPngAndJpeg) return std::nullopt;
  try {
    sandbox::ByteReader reader(result);
    Image image{number, source.name, source.open_file, read_properties(reader), decoder};
    require_memory(image.properties);
    return image;
  } catch (const std::runtime_error& error) {
    throw damaged(error, source.name);
  }
}

ImageSession::Image ImageSession::open_source(const Source& source) {
  const Decoder first = decoder_of(source.bytes);
  if (auto image = open_by(first, source)) return *std::move(image);
  return open_by(Decoder::kAllFormats, source).value();
}

ImageSession::Image ImageSession::open(const std::filesystem::path& file) {
  return open(file.string(), sandbox::only_file(file));
}

ImageSession::Image ImageSession::open(const std::string& name,
                                       const sandbox::OpenFile& open_file) {
  const std::string first = first_bytes(name, open_file);
  return open_source({name, "", first, open_file});
}

ImageSession::Image ImageSession::open_bytes(const std::string& name, const std::string& format,
                                             std::string_view bytes) {
  return open_source({name, format, bytes, no_file});
}

/// OpenImageIO reads a tile or up to 64 rows at once, as float at most.
void ImageSession::require_memory(const ImageProperties& properties) const {
  constexpr std::size_t kRows = 64;
  const bool has_tiles = properties.tile_width > 0;
  const auto width = static_cast<std::size_t>(has_tiles ? properties.tile_width : properties.width);
  const std::size_t height = has_tiles
                                 ? static_cast<std::size_t>(properties.tile_height)
                                 : std::min(kRows, static_cast<std::size_t>(properties.height));
  const std::size_t bytes =
      width * height * static_cast<std::size_t>(properties.channels) * sizeof(float);
  if (bytes > std::max(memory_bytes_, kSmallest)) {
    throw std::runtime_error("a tile or some rows of it need more memory than is granted");
  }
}

void ImageSession::close(const Image& image) {
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(ImageRequest::kClose));
  request.write(image.number);
  decode(image.decoder, request.take(), image.name, no_file);
}

std::optional<ImageProperties> ImageSession::level(const Image& image, int subimage, int level) {
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(ImageRequest::kLevel));
  request.write(image.number);
  request.write(subimage);
  request.write(level);
  const auto result = decode(image.decoder, request.take(), image.name, no_file);
  if (result.empty()) return std::nullopt;
  try {
    sandbox::ByteReader reader(result);
    const ImageProperties properties = read_properties(reader);
    // Levels become smaller: a decoder that always has another one must not go on for ever.
    constexpr int kMaxLevels = 32;
    const ImageProperties& first = image.properties;
    sandbox::ByteReader::require(
        subimage == 0 && level >= 0 && level < kMaxLevels && properties.width <= first.width &&
        properties.height <= first.height && properties.channels == first.channels);
    require_memory(properties);
    return properties;
  } catch (const std::runtime_error& error) {
    throw damaged(error, image.name);
  }
}

void ImageSession::read_part(const Image& image, const Part& part, std::span<std::byte> pixels) {
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(part.request));
  request.write(image.number);
  for (const int number : {part.subimage, part.level, part.first, part.second}) {
    request.write(number);
  }
  request.write(static_cast<std::uint8_t>(part.type));
  const auto result = decode(image.decoder, request.take(), image.name, image.open_file);
  if (result.size() != pixels.size()) {
    throw damaged(std::runtime_error("its decoder returned damaged data"), image.name);
  }
  std::memcpy(pixels.data(), result.data(), result.size());
}

void ImageSession::read_rows(const Image& image, int subimage, int level, int begin, int end,
                             PixelType type, std::span<std::byte> pixels) {
  read_part(image, {ImageRequest::kRows, subimage, level, begin, end, type}, pixels);
}

void ImageSession::read_tile(const Image& image, int subimage, int level, int x, int y,
                             PixelType type, std::span<std::byte> pixels) {
  read_part(image, {ImageRequest::kTile, subimage, level, x, y, type}, pixels);
}

}  // namespace raystage::images
