// SPDX-License-Identifier: Apache-2.0
#include "compose/exr_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <half.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "images/exr/exr_channels.h"
#include "images/exr/exr_slice.h"
#include "schemas/atomic_file.h"
#include "schemas/error.h"

namespace raystage {
namespace {

// Frames are parallel to each other; OpenEXR's own threads would only add to them.
constexpr int kNoThreads = 0;

/// OpenEXR's file writer closes in a destructor, where a full disk goes unnoticed. A frame is small
/// enough to be built in memory and written by ourselves.
class MemoryStream final : public Imf::OStream {
 public:
  MemoryStream() : Imf::OStream("memory") {}
  void write(const char c[], int n) override {
    const auto count = static_cast<std::size_t>(n);
    if (at_ + count > bytes_.size()) bytes_.resize(at_ + count);
    std::memcpy(bytes_.data() + at_, c, count);
    at_ += count;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }

  std::vector<std::byte> take() { return std::move(bytes_); }
  void reserve(std::size_t size) { bytes_.reserve(size); }

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
};

half finite_half(float value) {
  constexpr float kLargest = 65504.0F;  // of half
  if (std::isnan(value)) return half(0.0F);
  return half(std::clamp(value, -kLargest, kLargest));
}

std::size_t pixel_count(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

/// Scan lines that are compressed together (OpenEXR file layout); 1 is right for all, only slower.
int lines_per_chunk(Imf::Compression compression) {
  switch (compression) {
    case Imf::ZIP_COMPRESSION:
      return 16;
    case Imf::PIZ_COMPRESSION:
      return 32;
    default:
      return 1;
  }
}

}  // namespace

std::vector<std::byte> encode_exr(const RenderedView& view, const ExrMetadata& metadata) {
  const std::size_t pixels = pixel_count(view.width, view.height);
  std::vector<half> rgba(pixels * 4);
  std::transform(view.rgba.begin(), view.rgba.end(), rgba.begin(), finite_half);
  PixelValues z(view.z), coverage(view.coverage);
  const auto replace_nan = [](PixelValues& values, float by) {
    std::replace_if(
        values.begin(), values.end(), [](float v) { return std::isnan(v); }, by);
  };
  replace_nan(z, std::numeric_limits<float>::infinity());
  replace_nan(coverage, 0.0F);

  Imf::FrameBuffer frame_buffer;
  const char* const names[] = {"R", "G", "B", "A"};
  for (int c = 0; c < 4; ++c) {
    frame_buffer.insert(names[c], exr_slice(Imf::HALF, rgba.data() + c, view.width, 4, 0, 0, 0.0));
  }
  frame_buffer.insert("Z", exr_slice(Imf::FLOAT, z.data(), view.width, 1, 0, 0, 0.0));
  frame_buffer.insert("lf.coverage",
                      exr_slice(Imf::FLOAT, coverage.data(), view.width, 1, 0, 0, 0.0));

  PixelValues cameras(view.cameras), nearest(view.nearest_ray);
  if (metadata.coverage_measures) {
    cameras.resize(pixels, 0.0F);
    nearest.resize(pixels, std::numeric_limits<float>::infinity());
    replace_nan(cameras, 0.0F);
    replace_nan(nearest, std::numeric_limits<float>::infinity());
    frame_buffer.insert("lf.cameras",
                        exr_slice(Imf::FLOAT, cameras.data(), view.width, 1, 0, 0, 0.0));
    frame_buffer.insert("lf.nearest",
                        exr_slice(Imf::FLOAT, nearest.data(), view.width, 1, 0, 0, 0.0));
  }

  MemoryStream stream;
  stream.reserve(pixels * 8);
  {
    Imf::OutputFile output(stream, exr_header(view.width, view.height, metadata), kNoThreads);
    output.setFrameBuffer(frame_buffer);
    output.writePixels(view.height);
  }  // writes the line offsets
  return stream.take();
}

std::size_t write_exr(const RenderedView& view, const ExrMetadata& metadata,
                      const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = encode_exr(view, metadata);
  write_file_atomically(file, bytes);
  return bytes.size();
}

bool exr_is_whole(const std::filesystem::path& file, std::string_view fingerprint) {
  try {
    Imf::InputFile input(file.c_str(), kNoThreads);
    const auto* attribute =
        input.header().findTypedAttribute<Imf::StringAttribute>("lf:fingerprint");
    if (attribute == nullptr || attribute->value() != fingerprint || !input.isComplete()) {
      return false;
    }
    // The offsets may promise what a cut file no longer has: read it to its end.
    const Imath::Box2i window = input.header().dataWindow();
    const int step = lines_per_chunk(input.header().compression());
    for (std::int64_t y = window.min.y; y <= window.max.y; y += step) {
      const char* data = nullptr;
      int size = 0;
      input.rawPixelData(static_cast<int>(y), data, size);
    }
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

ExrImage read_exr(const std::filesystem::path& file) {
  constexpr ExrChannel kChannels[] = {{"R"}, {"G"}, {"B"}, {"A", 1.0F}};
  ExrPixels pixels = read_exr_channels(
      file, kChannels, "Give a flat EXR file with channels R, G and B, or render this frame again");
  ExrImage image{pixels.width, pixels.height, std::move(pixels.values)};
  if (pixels.fps_numerator > 0) {
    image.fps_numerator = pixels.fps_numerator;
    image.fps_denominator = pixels.fps_denominator;
  }
  return image;
}

}  // namespace raystage
