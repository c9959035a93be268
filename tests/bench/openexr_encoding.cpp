// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/openexr_encoding.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfOutputFile.h>

#include <string>

#include "compose/exr/memory_stream.h"

namespace raystage::testing {

OpenExrEncoding::OpenExrEncoding(std::span<const compose::ExrLayer> layers, int width, int height)
    : width_(width), height_(height) {
  for (const compose::ExrLayer& layer : layers) {
    Part& part = parts_.emplace_back();
    part.channels = layer.channels.size();
    part.is_colour = layer.is_colour;
    if (layer.is_half()) {
      part.halves.assign(layer.values.begin(), layer.values.end());
    } else {
      part.floats.assign(layer.values.begin(), layer.values.end());
    }
  }
}

std::size_t OpenExrEncoding::write(Imf::Compression colours, Imf::Compression data,
                                   int zip_level) const {
  std::size_t bytes = 0;
  for (const Part& part : parts_) {
    const bool is_half = part.floats.empty();
    Imf::Header header(width_, height_);
    header.compression() = part.is_colour ? colours : data;
    header.zipCompressionLevel() = zip_level;
    const Imf::PixelType type = is_half ? Imf::HALF : Imf::FLOAT;
    const std::size_t size = is_half ? sizeof(half) : sizeof(float);
    const auto* const pixels = is_half ? reinterpret_cast<const char*>(part.halves.data())
                                       : reinterpret_cast<const char*>(part.floats.data());
    Imf::FrameBuffer frame_buffer;
    for (std::size_t c = 0; c < part.channels; ++c) {
      const std::string name(1, static_cast<char>('A' + c));
      header.channels().insert(name, Imf::Channel(type));
      // OpenEXR only reads from the frame buffer of a file that it writes.
      frame_buffer.insert(name, Imf::Slice(type, const_cast<char*>(pixels + c * size),
                                           size * part.channels, size * part.channels * width_));
    }
    compose::MemoryStream stream;
    stream.reserve(static_cast<std::size_t>(width_) * height_ * part.channels * size);
    {
      Imf::OutputFile output(stream, header, compose::kNoExrThreads);
      output.setFrameBuffer(frame_buffer);
      output.writePixels(height_);
    }
    bytes += stream.take().size();
  }
  return bytes;
}

}  // namespace raystage::testing
