// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/exr_deep_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDeepFrameBuffer.h>
#include <OpenEXR/ImfDeepScanLineOutputPart.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <half.h>

#include <array>

#include "compose/exr/memory_stream.h"
#include "images/exr_slice.h"

namespace raystage::compose {
namespace {

constexpr std::size_t kValues = 5;  // R, G, B, A, Z
constexpr std::array<const char*, 4> kColours{"R", "G", "B", "A"};

/// The samples of a part as written. OpenEXR needs a pointer for each pixel and channel.
struct DeepPixels {
  std::vector<unsigned int> counts;
  std::vector<half> colours;  // R of all samples, then G ...
  std::vector<float> depths;
  std::array<std::vector<const void*>, kValues> first;  // of each pixel
  Imf::DeepFrameBuffer frame_buffer;
};

/// Returns the address of pixel (0, 0), which may be outside of the memory.
template <class T>
char* base_of(std::vector<T>& values, const ExrCamera& camera) {
  return images::make_exr_slice(Imf::UINT, values.data(), camera.view.width, 1, -camera.overscan_x,
                                -camera.overscan_y, 0.0)
      .base;
}

DeepPixels pixels_of_view(const ExrDeepView& view, const ExrCamera& camera) {
  DeepPixels pixels;
  const std::size_t samples = view.samples.size() / kValues, count = view.begin.size() - 1;
  pixels.colours.resize(4 * samples);
  pixels.depths.resize(samples);
  for (std::size_t i = 0; i < samples; ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      pixels.colours[c * samples + i] = clamp_to_half(view.samples[kValues * i + c]);
    }
    pixels.depths[i] = view.samples[kValues * i + 4];
  }
  pixels.counts.resize(count);
  for (auto& first : pixels.first) first.resize(count);
  for (std::size_t pixel = 0; pixel < count; ++pixel) {
    pixels.counts[pixel] = view.begin[pixel + 1] - view.begin[pixel];
    for (std::size_t c = 0; c < 4; ++c) {
      pixels.first[c][pixel] = pixels.colours.data() + c * samples + view.begin[pixel];
    }
    pixels.first[4][pixel] = pixels.depths.data() + view.begin[pixel];
  }
  const auto columns = static_cast<std::size_t>(camera.view.width);
  pixels.frame_buffer.insertSampleCountSlice(Imf::Slice(Imf::UINT, base_of(pixels.counts, camera),
                                                        sizeof(unsigned int),
                                                        sizeof(unsigned int) * columns));
  for (std::size_t c = 0; c < kValues; ++c) {
    const bool is_colour = c < 4;
    pixels.frame_buffer.insert(
        is_colour ? kColours[c] : "Z",
        Imf::DeepSlice(is_colour ? Imf::HALF : Imf::FLOAT, base_of(pixels.first[c], camera),
                       sizeof(void*), sizeof(void*) * columns,
                       is_colour ? sizeof(half) : sizeof(float)));
  }
  return pixels;
}

Imf::Header header_of(const ExrDeepView& view, std::size_t index, std::size_t views,
                      const ExrCamera& camera, const ExrMetadata& metadata) {
  ExrPart part;
  part.name = views > 1 ? "deep." + view.name : "deep";
  part.view = view.name;
  part.camera_view_index = index;
  ExrMetadata of_deep = metadata;
  // Deep files only have chunks of one line.
  if (of_deep.compression != "none" && of_deep.compression != "rle") of_deep.compression = "zips";
  Imf::Header header = exr_header(part, camera, of_deep);
  header.setType(Imf::DEEPSCANLINE);
  for (const char* colour : kColours) header.channels().insert(colour, Imf::Channel(Imf::HALF));
  header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
  addDeepImageState(header, Imf::DIS_SORTED);
  return header;
}

}  // namespace

std::vector<std::byte> encode_deep_exr(std::span<const ExrDeepView> views,
                                       std::span<const ExrCamera> cameras,
                                       const ExrMetadata& metadata) {
  std::vector<Imf::Header> headers;
  for (std::size_t i = 0; i < views.size(); ++i) {
    headers.push_back(header_of(views[i], i, views.size(), cameras[i], metadata));
  }
  MemoryStream stream;
  {
    Imf::MultiPartOutputFile output(stream, headers.data(), static_cast<int>(headers.size()), false,
                                    kNoExrThreads);
    for (std::size_t i = 0; i < views.size(); ++i) {
      const DeepPixels pixels = pixels_of_view(views[i], cameras[i]);
      Imf::DeepScanLineOutputPart part(output, static_cast<int>(i));
      part.setFrameBuffer(pixels.frame_buffer);
      part.writePixels(cameras[i].view.height);
    }
  }  // writes the line offsets
  return stream.take();
}

}  // namespace raystage::compose
