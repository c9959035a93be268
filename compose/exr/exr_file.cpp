// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/exr_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDeepScanLineInputPart.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfMultiView.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <half.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "compose/exr/memory_stream.h"
#include "images/exr_channels.h"
#include "images/exr_slice.h"

namespace raystage::compose {
namespace {

/// Returns the scan lines per chunk (OpenEXR file layout); 1 is correct for all, only slower.
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

/// The pixels of a part as written: halves, and floats without NaN.
struct PartPixels {
  std::vector<half> halves;
  std::vector<float> data;
  Imf::FrameBuffer frame_buffer;
};

/// Returns the pixels of a part, and adds its channels to the header.
PartPixels pixels_of(const ExrPart& part, std::span<const ExrView> views, const ExrCamera& camera,
                     Imf::Header& header) {
  const auto slice = [&](Imf::PixelType type, auto* first) {
    return images::make_exr_slice(type, first, camera.view.width, 1, -camera.overscan_x,
                                  -camera.overscan_y, 0.0);
  };
  const auto layer_of = [&](const ExrPartChannel& channel) -> const ExrLayer& {
    return views[channel.view].layers[channel.layer];
  };
  PartPixels pixels;
  std::size_t halves = 0, data = 0;
  for (const ExrPartChannel& channel : part.channels) {
    const ExrLayer& layer = layer_of(channel);
    (layer.is_half() ? halves : data) += layer.values.size() / layer.channels.size();
  }
  pixels.halves.resize(halves);
  pixels.data.resize(data);
  half* at_half = pixels.halves.data();
  float* number = pixels.data.data();
  for (const ExrPartChannel& channel : part.channels) {
    const ExrLayer& layer = layer_of(channel);
    const std::size_t stride = layer.channels.size(), count = layer.values.size() / stride;
    const float* from = layer.values.data() + channel.channel;
    if (layer.is_half()) {
      for (std::size_t i = 0; i < count; ++i) at_half[i] = clamp_to_half(from[i * stride]);
      pixels.frame_buffer.insert(channel.name, slice(Imf::HALF, at_half));
      at_half += count;
    } else {
      for (std::size_t i = 0; i < count; ++i) {
        const float value = from[i * stride];
        number[i] = std::isnan(value) ? layer.nan_replacement : value;
      }
      pixels.frame_buffer.insert(channel.name, slice(Imf::FLOAT, number));
      number += count;
    }
    // pLinear stays false: coverage is data.
    header.channels().insert(channel.name, Imf::Channel(layer.is_half() ? Imf::HALF : Imf::FLOAT));
  }
  return pixels;
}

/// Reads all chunks. Throws if one is missing.
void read_deep_part(Imf::MultiPartInputFile& input, int index) {
  Imf::DeepScanLineInputPart part(input, index);
  const Imath::Box2i window = part.header().dataWindow();
  std::vector<char> chunk;
  for (std::int64_t y = window.min.y; y <= window.max.y; ++y) {  // one line per chunk
    std::uint64_t size = 0;
    part.rawPixelData(static_cast<int>(y), nullptr, size);
    chunk.resize(size);
    part.rawPixelData(static_cast<int>(y), chunk.data(), size);
  }
}

}  // namespace

std::vector<std::byte> encode_exr(std::span<const ExrView> views,
                                  std::span<const ExrCamera> cameras, const ExrMetadata& metadata) {
  const std::vector<ExrPart> parts = make_exr_parts(views, metadata.layout);
  std::vector<PartPixels> pixels;
  std::vector<Imf::Header> headers;
  for (const ExrPart& part : parts) {
    headers.push_back(exr_header(part, cameras[part.camera_view_index], metadata));
    pixels.push_back(pixels_of(part, views, cameras[0], headers.back()));
  }
  if (parts.size() == 1 && views.size() > 1) {
    Imf::StringVector names;
    for (const ExrView& view : views) names.push_back(view.name);
    addMultiView(headers[0], names);
  }
  MemoryStream stream;
  const int height = cameras[0].view.height;
  stream.reserve(std::size_t{8} * cameras[0].view.width * height);
  if (parts.size() == 1) {
    Imf::OutputFile output(stream, headers[0], kNoExrThreads);
    output.setFrameBuffer(pixels[0].frame_buffer);
    output.writePixels(height);
  } else {
    Imf::MultiPartOutputFile output(stream, headers.data(), static_cast<int>(headers.size()), false,
                                    kNoExrThreads);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      Imf::OutputPart part(output, static_cast<int>(i));
      part.setFrameBuffer(pixels[i].frame_buffer);
      part.writePixels(height);
    }
  }  // writes the line offsets
  return stream.take();
}

bool is_complete_exr(const std::filesystem::path& file, std::string_view fingerprint) {
  try {
    Imf::MultiPartInputFile input(file.c_str(), kNoExrThreads);
    for (int i = 0; i < input.parts(); ++i) {
      const Imf::Header& header = input.header(i);
      const auto* attribute = header.findTypedAttribute<Imf::StringAttribute>("lf:fingerprint");
      if (attribute == nullptr || attribute->value() != fingerprint || !input.partComplete(i)) {
        return false;
      }
      // A truncated file may have all offsets: read all chunks.
      if (header.hasType() && header.type() == Imf::DEEPSCANLINE) {
        read_deep_part(input, i);
        continue;
      }
      Imf::InputPart part(input, i);
      const Imath::Box2i window = header.dataWindow();
      const int step = lines_per_chunk(header.compression());
      for (std::int64_t y = window.min.y; y <= window.max.y; y += step) {
        const char* data = nullptr;
        int size = 0;
        part.rawPixelData(static_cast<int>(y), data, size);
      }
    }
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

ExrImage read_exr(const std::filesystem::path& file) {
  constexpr images::ExrChannel kChannels[] = {{"R"}, {"G"}, {"B"}, {"A", 1.0F}};
  images::ExrChannelData pixels = images::read_exr_channels(
      file, kChannels, "Give a flat EXR file with channels R, G and B, or render this frame again");
  ExrImage image{pixels.width, pixels.height, std::move(pixels.values)};
  image.time_code = pixels.time_code;
  image.color_interop_id = pixels.color_interop_id;
  image.color_space = pixels.color_space;
  if (pixels.fps_numerator > 0) {
    image.fps_numerator = pixels.fps_numerator;
    image.fps_denominator = pixels.fps_denominator;
  }
  return image;
}

}  // namespace raystage::compose
