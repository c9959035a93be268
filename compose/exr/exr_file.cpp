// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/exr_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfMultiView.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <half.h>

#include <algorithm>
#include <cstdint>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "compose/exr/chunk_kernels.h"
#include "compose/exr/memory_stream.h"
#include "compose/exr/scanline_file.h"
#include "images/exr_reader.h"
#include "images/exr_slice.h"

namespace raystage::compose {
namespace {

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

std::optional<FrameQuality> find_complete_exr(const images::ExrReader& reader,
                                              const std::filesystem::path& file,
                                              std::string_view fingerprint) {
  std::error_code unknown;
  if (!std::filesystem::is_regular_file(file, unknown)) return std::nullopt;
  try {
    images::ExrInspection found = reader.inspect(file);
    if (!found.is_complete || found.fingerprint != fingerprint) return std::nullopt;
    return FrameQuality{found.covered_share, std::move(found.rotten_cameras)};
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    return std::nullopt;
  }
}

bool is_complete_exr(const std::filesystem::path& file, std::string_view fingerprint) {
  return find_complete_exr(images::ExrReader(), file, fingerprint).has_value();
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

FrameQuality read_frame_quality(const images::ExrReader& reader,
                                const std::filesystem::path& file) {
  images::ExrInspection found = reader.inspect(file);
  return {found.covered_share, std::move(found.rotten_cameras)};
}

FrameQuality read_frame_quality(const std::filesystem::path& file) {
  return read_frame_quality(images::ExrReader(), file);
}

}  // namespace raystage::compose
