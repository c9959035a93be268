// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/exr_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDeepScanLineInputPart.h>
#include <OpenEXR/ImfDoubleAttribute.h>
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
#include <cstdint>

#include "base/error.h"
#include "compose/exr/chunk_kernels.h"
#include "compose/exr/memory_stream.h"
#include "compose/exr/scanline_file.h"
#include "images/exr_reader.h"
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

/// Returns the channels of a part.
std::vector<ScanlineChannel> channels_of(const ExrPart& part, std::span<const ExrView> views) {
  std::vector<ScanlineChannel> channels;
  for (const ExrPartChannel& channel : part.channels) {
    const ExrLayer& layer = views[channel.view].layers[channel.layer];
    channels.push_back({channel.name, layer.is_half(), layer.values.data() + channel.channel,
                        layer.channels.size(), layer.nan_replacement});
  }
  return channels;
}

/// The pixels of a part as OpenEXR takes them: halves, and floats without NaN.
struct PartPixels {
  std::vector<std::uint8_t> values;
  Imf::FrameBuffer frame_buffer;
};

/// Returns the pixels of a part, and adds its channels to the header.
PartPixels pixels_of(ScanlinePart& part) {
  const Imath::Box2i window = part.header.dataWindow();
  const int width = window.max.x - window.min.x + 1;
  const auto count = static_cast<std::size_t>(width) * (window.max.y - window.min.y + 1);
  PartPixels pixels;
  std::size_t bytes = 0;
  for (const ScanlineChannel& channel : part.channels) bytes += count * (channel.is_half ? 2 : 4);
  pixels.values.resize(bytes);
  std::uint8_t* to = pixels.values.data();
  for (const bool is_half : {false, true}) {  // floats first: each value is aligned
    for (const ScanlineChannel& channel : part.channels) {
      if (channel.is_half != is_half) continue;
      if (is_half) {
        convert_to_halves(channel.first, channel.stride, count, to);
      } else {
        copy_without_nan(channel.first, channel.stride, count, channel.nan_replacement, to);
      }
      const Imf::PixelType type = is_half ? Imf::HALF : Imf::FLOAT;
      const auto slice = [&](auto* first) {
        return images::make_exr_slice(type, first, width, 1, window.min.x, window.min.y, 0.0);
      };
      pixels.frame_buffer.insert(channel.name, is_half ? slice(reinterpret_cast<half*>(to))
                                                       : slice(reinterpret_cast<float*>(to)));
      to += count * (is_half ? 2 : 4);
      // pLinear stays false: coverage is data.
      part.header.channels().insert(channel.name, Imf::Channel(type));
    }
  }
  return pixels;
}

/// Returns the bytes of a file that OpenEXR compresses.
std::vector<std::byte> write_with_openexr(std::span<ScanlinePart> parts) {
  std::vector<PartPixels> pixels;
  std::vector<Imf::Header> headers;
  for (ScanlinePart& part : parts) {
    pixels.push_back(pixels_of(part));
    headers.push_back(part.header);
  }
  const Imath::Box2i window = headers[0].dataWindow();
  const int height = window.max.y - window.min.y + 1;
  MemoryStream stream;
  stream.reserve(std::size_t{8} * (window.max.x - window.min.x + 1) * height);
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
  std::vector<ScanlinePart> parts;
  for (const ExrPart& part : make_exr_parts(views, metadata.layout)) {
    parts.push_back(
        {exr_header(part, cameras[part.camera_view_index], metadata), channels_of(part, views)});
  }
  if (parts.size() == 1 && views.size() > 1) {
    Imf::StringVector names;
    for (const ExrView& view : views) names.push_back(view.name);
    addMultiView(parts[0].header, names);
  }
  const bool is_ours = std::ranges::all_of(parts, [](const ScanlinePart& part) {
    return is_scanline_file_compression(part.header.compression());
  });
  return is_ours ? write_scanline_file(parts) : write_with_openexr(parts);
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

ExrImage read_exr(const images::ExrReader& reader, const std::filesystem::path& file,
                  const std::string& view) {
  constexpr images::ExrChannel kChannels[] = {{"R"}, {"G"}, {"B"}, {"A", 1.0F}};
  const std::string what_to_do =
      "Give a flat EXR file with channels R, G and B, or render this frame again";
  images::ExrChannelData pixels =
      view.empty() ? reader.read(file, kChannels, what_to_do)
                   : reader.read_view(file, view, kChannels, "Give frames of a stereo shot");
  ExrImage image{pixels.width, pixels.height, std::move(pixels.values)};
  image.time_code = pixels.time_code;
  image.color_interop_id = pixels.color_interop_id;
  image.color_space = pixels.color_space;
  image.is_equirectangular = pixels.is_equirectangular;
  if (pixels.fps_numerator > 0) {
    image.fps_numerator = pixels.fps_numerator;
    image.fps_denominator = pixels.fps_denominator;
  }
  return image;
}

ExrImage read_exr(const std::filesystem::path& file, const std::string& view) {
  return read_exr(images::ExrReader(), file, view);
}

FrameQuality read_frame_quality(const std::filesystem::path& file) {
  try {
    const Imf::MultiPartInputFile input(file.c_str(), kNoExrThreads);
    const Imf::Header& header = input.header(0);
    FrameQuality quality;
    if (const auto* share = header.findTypedAttribute<Imf::DoubleAttribute>("lf:coveredShare")) {
      quality.covered_share = share->value();
    }
    if (const auto* rotten =
            header.findTypedAttribute<Imf::StringVectorAttribute>("lf:rottenCameras")) {
      quality.rotten_cameras = rotten->value();
    }
    return quality;
  } catch (const std::exception& error) {
    throw Error::bad_input(error.what(), file.string(), "Render the frame again");
  }
}

}  // namespace raystage::compose
