// SPDX-License-Identifier: Apache-2.0
#include "images/image_reader.h"

#include <cstring>
#include <span>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "base/resources.h"
#include "images/image_decoder_options.h"
#include "images/image_requests.h"

namespace raystage::images {
namespace {

void require_file(const std::filesystem::path& file) {
  std::error_code error;
  if (std::filesystem::is_regular_file(file, error)) return;
  throw Error::bad_input(std::filesystem::exists(file, error)
                             ? "the image cannot be read: it is not a regular file"
                             : "the image does not exist",
                         file.string(), "Correct the path");
}

/// Returns read(reader of the result). Converts exceptions about damaged results to Errors.
template <class Read>
auto read_result(std::span<const std::byte> result, const std::filesystem::path& file,
                 const Read& read) {
  try {
    sandbox::ByteReader reader(result);
    return read(reader);
  } catch (const std::runtime_error& error) {
    throw Error::bad_input(std::string("the image cannot be read: ") + error.what(), file.string(),
                           "Save it again");
  }
}

std::size_t granted(std::size_t memory_bytes) {
  return memory_bytes > 0 ? memory_bytes : static_cast<std::size_t>(available_memory() / 2);
}

}  // namespace

ImageReader::ImageReader(std::size_t memory_bytes)
    : ImageReader(granted(memory_bytes), image_decoder_options("image", granted(memory_bytes))) {}

ImageReader::ImageReader(std::size_t memory_bytes, sandbox::DecoderOptions options)
    : memory_bytes_(memory_bytes), decoders_(std::move(options)) {}

ImageReader ImageReader::of_png_plates(std::size_t memory_bytes) {
  const std::size_t bytes = granted(memory_bytes);
  sandbox::DecoderOptions options = image_decoder_options("plate", bytes);
  options.program = "raystage-decode-png";
  options.advice = "Save it as EXR, or as PNG with 8 bits that is not larger than needed";
  return {bytes, std::move(options)};
}

ImageProperties ImageReader::properties(const std::filesystem::path& file) const {
  require_file(file);
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(ImageRequest::kProperties));
  write_source(request, {.name = file.string(), .format = {}, .memory_bytes = memory_bytes_});
  const auto result = decoders_.decode(request.take(), file, sandbox::only_file(file));
  return read_result(result, file, read_properties);
}

template <class Value>
ImageValues<Value> ImageReader::read(const std::filesystem::path& file, PixelType type) const {
  require_file(file);
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(ImageRequest::kRead));
  write_source(request, {.name = file.string(), .format = {}, .memory_bytes = memory_bytes_});
  request.write(static_cast<std::uint8_t>(type));
  const auto result = decoders_.decode(request.take(), file, sandbox::only_file(file));
  return read_result(result, file, [](sandbox::ByteReader& reader) {
    ImageValues<Value> image{read_properties(reader), {}};
    const auto bytes = reader.read_rest();
    const std::size_t count =
        image.properties.pixels() * static_cast<std::size_t>(image.properties.channels);
    sandbox::ByteReader::require(bytes.size() == count * sizeof(Value));
    image.values.resize(count);
    std::memcpy(image.values.data(), bytes.data(), bytes.size());
    return image;
  });
}

ImageValues<std::uint8_t> ImageReader::read_codes(const std::filesystem::path& file) const {
  return read<std::uint8_t>(file, PixelType::kUint8);
}

ImageValues<float> ImageReader::read_floats(const std::filesystem::path& file) const {
  return read<float>(file, PixelType::kFloat);
}

store::RgbImage ImageReader::read_rgb(const std::filesystem::path& file) const {
  const ImageValues<std::uint8_t> codes = read_codes(file);
  const auto channels = static_cast<std::size_t>(codes.properties.channels);
  store::RgbImage image(codes.properties.width, codes.properties.height);
  for (std::size_t pixel = 0; pixel < codes.properties.pixels(); ++pixel) {
    for (std::size_t c = 0; c < 3; ++c) {
      image.values[pixel * 3 + c] = codes.values[pixel * channels + (channels >= 3 ? c : 0)];
    }
  }
  return image;
}

}  // namespace raystage::images
