// SPDX-License-Identifier: Apache-2.0
// Runs libjxl in decoders' processes (raystage-transcode-jpeg). What a process returns is checked
// here: size, form, bits, and that no half float is infinite or not a number.
#include "store/jpegxl/picture_codec.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/half_float.h"
#include "base/posix_file.h"
#include "sandbox/decoder_pool.h"
#include "sandbox/machine_limits.h"
#include "store/jpegxl/packed_frame.h"
#include "store/jpegxl/picture_requests.h"
#include "store/jpegxl/transcoding_requests.h"

namespace raystage::store {
namespace {

constexpr const char* kPictureAdvice = "Run `raystage verify --decode` on the take, then repair it";

/// Most memory that libjxl takes for a picture, bytes: samples as 32-bit integers and floats, the
/// trees of contexts and their training samples, input and output.
std::uint64_t picture_memory_for(std::uint64_t pixels) {
  constexpr std::uint64_t kBytesPerPixel = 256, kOther = std::uint64_t{256} << 20;
  return kOther + kBytesPerPixel * pixels;
}

sandbox::DecoderOptions picture_options(std::uint64_t pixels) {
  constexpr std::uint64_t kSampleBytes = 6, kHeader = 4096;
  sandbox::DecoderOptions options;
  options.program = "raystage-transcode-jpeg";
  options.kind = "JPEG XL picture";
  options.advice = kPictureAdvice;
  options.memory_bytes = picture_memory_for(pixels);
  options.result_bytes = std::max<std::uint64_t>(kMaxFrameBytes, kSampleBytes * pixels) + kHeader;
  // More than ten times what a core of 2020 takes to encode.
  constexpr std::uint64_t kStartSeconds = 60, kSecondsPerMegapixel = 10, kMegapixel = 1'000'000;
  options.time =
      std::chrono::seconds(kStartSeconds + (pixels / kMegapixel + 1) * kSecondsPerMegapixel);
  return sandbox::within_machine(std::move(options));
}

std::uint64_t pixel_count(int width, int height) {
  return static_cast<std::uint64_t>(std::max(width, 1)) *
         static_cast<std::uint64_t>(std::max(height, 1));
}

}  // namespace

struct PictureCodec::State {
  // By the pixels that they accept, rounded up to a power of two.
  std::map<std::uint64_t, sandbox::DecoderPool> decoders;
  std::mutex mutex;

  const sandbox::DecoderPool& decoders_for(std::uint64_t pixels) {
    const std::uint64_t most = std::bit_ceil(pixels);
    const std::scoped_lock lock(mutex);
    return decoders.try_emplace(most, picture_options(most)).first->second;
  }

  std::vector<std::byte> ask(std::uint64_t pixels, std::vector<std::byte> request,
                             const std::filesystem::path& name) {
    return decoders_for(pixels).decode(std::move(request), name, [](const std::string&) {
      return FileDescriptor(-1);  // it needs no file
    });
  }
};

PictureCodec::PictureCodec() : state_(std::make_unique<State>()) {}
PictureCodec::~PictureCodec() = default;
PictureCodec::PictureCodec(PictureCodec&&) noexcept = default;
PictureCodec& PictureCodec::operator=(PictureCodec&&) noexcept = default;

std::vector<std::byte> PictureCodec::encode(const DeepPicture& picture,
                                            const schemas::PixelEncoding& encoding,
                                            const PictureCompression& compression,
                                            const std::filesystem::path& file) const {
  const std::uint64_t pixels = pixel_count(picture.width, picture.height);
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(TranscodingRequest::kEncodePicture));
  request.write(pixels);
  write_encoding(request, encoding);
  request.write(compression.distance);
  request.write(static_cast<std::uint8_t>(compression.effort));
  write_picture(request, picture);
  std::vector<std::byte> stream = state_->ask(pixels, request.take(), file);
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input("the picture cannot be stored as JPEG XL: " + what, file.string(),
                            "Import the picture with 8 bits, or report this with the version of "
                            "libjxl");
  };
  if (stream.size() > kMaxFrameBytes) throw refuse("it has more than 256 MiB");
  const DeepPicture again = decode(stream, picture.width, picture.height, &encoding, file);
  if (compression.distance <= 0 && again != picture) throw refuse("it does not return bit for bit");
  return stream;
}

DeepPicture PictureCodec::decode(std::span<const std::byte> coded_bytes, int width, int height,
                                 const schemas::PixelEncoding* expected,
                                 const std::filesystem::path& file) const {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input("the JPEG XL picture cannot be read: " + what, file.string(),
                            kPictureAdvice);
  };
  if (!is_jpeg_xl_picture(coded_bytes)) throw refuse("it does not begin as one");
  const std::uint64_t pixels = pixel_count(width, height);
  sandbox::ByteWriter request;
  request.write(static_cast<std::uint8_t>(TranscodingRequest::kDecodePicture));
  request.write(pixels);
  request.append(coded_bytes);
  const std::vector<std::byte> result = state_->ask(pixels, request.take(), file);
  CodedPicture coded;
  try {
    sandbox::ByteReader reader(result);
    coded = read_coded_picture(reader);
  } catch (const std::runtime_error& error) {
    throw refuse(error.what());
  }
  if (coded.picture.width != width || coded.picture.height != height) {
    throw refuse("it has " + std::to_string(coded.picture.width) + " x " +
                 std::to_string(coded.picture.height) + " pixels, its camera " +
                 std::to_string(width) + " x " + std::to_string(height));
  }
  if (expected != nullptr && (coded.samples != expected->samples || coded.bits != expected->bits)) {
    throw refuse("its samples have another form or number of bits than take.json states");
  }
  if (coded.samples == schemas::PixelEncoding::Samples::kHalf &&
      !std::ranges::all_of(coded.picture.samples, is_finite_half)) {
    throw refuse("samples are infinite or not numbers");
  }
  return std::move(coded.picture);
}

bool is_jpeg_xl_picture(std::span<const std::byte> bytes) {
  const bool is_codestream =
      bytes.size() >= 2 && bytes[0] == std::byte{0xFF} && bytes[1] == std::byte{0x0A};
  return is_codestream || is_jpeg_xl(bytes);
}

}  // namespace raystage::store
