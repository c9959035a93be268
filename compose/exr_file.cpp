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

/// A slice of `bytes`-wide samples, `channels` apart, over a window that starts at (x0, y0).
/// OpenEXR takes the address of pixel (0, 0), which may lie outside the memory; it is computed as a
/// number because a pointer must not go there.
template <class T>
Imf::Slice slice(Imf::PixelType type, T* first, int width, int channels, int x0, int y0,
                 double fill) {
  const auto x_stride = static_cast<std::intptr_t>(sizeof(T)) * channels;
  const std::intptr_t y_stride = x_stride * width;
  const std::intptr_t base = reinterpret_cast<std::intptr_t>(first) - x0 * x_stride - y0 * y_stride;
  return {type,
          reinterpret_cast<char*>(base),
          static_cast<std::size_t>(x_stride),
          static_cast<std::size_t>(y_stride),
          1,
          1,
          fill};
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

ExrImage read_open_file(Imf::InputFile& input, const std::filesystem::path& file) {
  const Imf::Header& header = input.header();
  const Imf::ChannelList& channels = header.channels();
  if (channels.findChannel("R") == nullptr || channels.findChannel("G") == nullptr ||
      channels.findChannel("B") == nullptr) {
    throw Error::bad_input("the EXR file has no channels R, G and B", file.string(),
                           "Give a colour image");
  }
  const Imath::Box2i data = header.dataWindow(), display = header.displayWindow();
  constexpr std::int64_t kMaxPixels = std::int64_t{1} << 29;
  const auto area = [](const Imath::Box2i& box) {
    return (std::int64_t{box.max.x} - box.min.x + 1) * (std::int64_t{box.max.y} - box.min.y + 1);
  };
  if (area(data) > kMaxPixels || area(display) > kMaxPixels) {
    throw Error::bad_input("the EXR file is larger than 2^29 pixels", file.string(),
                           "Give a smaller image");
  }

  const int data_width = data.max.x - data.min.x + 1, data_height = data.max.y - data.min.y + 1;
  std::vector<float> pixels(pixel_count(data_width, data_height) * 4);
  Imf::FrameBuffer frame_buffer;
  const char* const names[] = {"R", "G", "B", "A"};
  for (int c = 0; c < 4; ++c) {
    frame_buffer.insert(names[c], slice(Imf::FLOAT, pixels.data() + c, data_width, 4, data.min.x,
                                        data.min.y, c == 3 ? 1.0 : 0.0));
  }
  input.setFrameBuffer(frame_buffer);
  input.readPixels(data.min.y, data.max.y);

  ExrImage image;
  if (Imf::hasFramesPerSecond(header)) {
    const Imf::Rational fps = Imf::framesPerSecond(header);
    if (fps.n > 0 && fps.d > 0 && fps.d <= static_cast<unsigned>(std::numeric_limits<int>::max())) {
      image.fps_numerator = fps.n;
      image.fps_denominator = static_cast<int>(fps.d);
    }
  }
  image.width = display.max.x - display.min.x + 1;
  image.height = display.max.y - display.min.y + 1;
  if (data == display) {
    image.rgba = std::move(pixels);
    return image;
  }
  image.rgba.assign(pixel_count(image.width, image.height) * 4, 0.0F);
  const int x0 = std::max(data.min.x, display.min.x), x1 = std::min(data.max.x, display.max.x);
  const int y0 = std::max(data.min.y, display.min.y), y1 = std::min(data.max.y, display.max.y);
  for (int y = y0; y <= y1 && x0 <= x1; ++y) {
    const float* from =
        pixels.data() +
        (pixel_count(data_width, y - data.min.y) + static_cast<std::size_t>(x0 - data.min.x)) * 4;
    float* to = image.rgba.data() + (pixel_count(image.width, y - display.min.y) +
                                     static_cast<std::size_t>(x0 - display.min.x)) *
                                        4;
    std::copy_n(from, static_cast<std::size_t>(x1 - x0 + 1) * 4, to);
  }
  return image;
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
    frame_buffer.insert(names[c], slice(Imf::HALF, rgba.data() + c, view.width, 4, 0, 0, 0.0));
  }
  frame_buffer.insert("Z", slice(Imf::FLOAT, z.data(), view.width, 1, 0, 0, 0.0));
  frame_buffer.insert("lf.coverage", slice(Imf::FLOAT, coverage.data(), view.width, 1, 0, 0, 0.0));

  PixelValues cameras(view.cameras), nearest(view.nearest_ray);
  if (metadata.coverage_measures) {
    cameras.resize(pixels, 0.0F);
    nearest.resize(pixels, std::numeric_limits<float>::infinity());
    replace_nan(cameras, 0.0F);
    replace_nan(nearest, std::numeric_limits<float>::infinity());
    frame_buffer.insert("lf.cameras", slice(Imf::FLOAT, cameras.data(), view.width, 1, 0, 0, 0.0));
    frame_buffer.insert("lf.nearest", slice(Imf::FLOAT, nearest.data(), view.width, 1, 0, 0, 0.0));
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
  try {
    Imf::InputFile input(file.c_str(), kNoThreads);
    return read_open_file(input, file);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    std::string what = error.what();
    while (!what.empty() && (what.back() == '.' || what.back() == '\n')) what.pop_back();
    throw Error::bad_input("the EXR file cannot be read: " + what, file.string(),
                           "Render this frame again");
  }
}

}  // namespace raystage
