// SPDX-License-Identifier: Apache-2.0
// Converts between JPEG and the planes that video codecs take, by libjpeg-turbo (accurate integer
// DCT) and without RGB in between. Cost: one decoding or encoding of a JPEG.
#include "store/temporal/planes.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/layout.h"
#include "store/jpeg/libjpeg.h"

namespace raystage::store {
namespace {

std::size_t as_size(int value) { return static_cast<std::size_t>(value); }

int step_of(ChromaStep chroma, std::size_t plane) {
  return plane == 0 ? 1 : static_cast<int>(chroma);
}

Planes empty_planes(int width, int height, ChromaStep chroma) {
  Planes planes;
  planes.chroma = chroma;
  planes.width = coded_side(width);
  planes.height = coded_side(height);
  const std::size_t samples = as_size(planes.width) * as_size(planes.height);
  constexpr std::uint8_t kNoColour = 128;
  const std::size_t chroma_samples = chroma == ChromaStep::k444 ? samples : samples / 4;
  planes.plane = {std::vector<std::uint8_t>(samples),
                  std::vector<std::uint8_t>(chroma_samples, kNoColour),
                  std::vector<std::uint8_t>(chroma_samples, kNoColour)};
  return planes;
}

/// Decodes to interleaved samples, `components` (1 or 3) a pixel. Chroma is replicated, not
/// interpolated, so that averages return the samples of 4:2:0.
std::vector<std::uint8_t> interleaved_samples(std::span<const std::byte> jpeg, int width,
                                              int height, std::string_view name, int& components) {
  parse_jpeg_layout(jpeg, name);  // limits the scans
  libjpeg::Decompressor decompressor;
  jpeg_decompress_struct& info = decompressor.info;
  bool is_supported = false, is_size = false;
  if (!libjpeg::guarded(decompressor.errors, [&] {
        decompressor.set_input(jpeg);
        jpeg_read_header(&info, TRUE);
      })) {
    libjpeg::throw_error(decompressor.errors, name);
  }
  is_supported = info.jpeg_color_space == JCS_YCbCr || info.jpeg_color_space == JCS_GRAYSCALE;
  is_size = info.image_width == static_cast<JDIMENSION>(width) &&
            info.image_height == static_cast<JDIMENSION>(height);
  if (!is_supported || !is_size) {
    throw Error::bad_input(is_size ? "the frame is neither Y'CbCr nor grey"
                                   : "the frame has another size than its camera",
                           std::string(name), "Pack the take without loss instead");
  }
  components = info.jpeg_color_space == JCS_YCbCr ? 3 : 1;
  std::vector<std::uint8_t> samples(as_size(width) * as_size(height) * as_size(components));
  const std::size_t row_bytes = as_size(width) * as_size(components);
  if (!libjpeg::guarded(decompressor.errors, [&] {
        info.out_color_space = info.jpeg_color_space;
        info.do_fancy_upsampling = FALSE;
        info.dct_method = JDCT_ISLOW;
        jpeg_start_decompress(&info);
        while (info.output_scanline < info.output_height) {
          JSAMPROW row = samples.data() + info.output_scanline * row_bytes;
          jpeg_read_scanlines(&info, &row, 1);
        }
        jpeg_finish_decompress(&info);
      })) {
    libjpeg::throw_error(decompressor.errors, name);
  }
  return samples;
}

}  // namespace

int coded_side(int side) { return std::max(64, (side + 7) / 8 * 8); }

Planes planes_of_jpeg(std::span<const std::byte> jpeg, int width, int height, std::string_view name,
                      ChromaStep chroma) {
  int components = 0;
  const auto samples = interleaved_samples(jpeg, width, height, name, components);
  Planes planes = empty_planes(width, height, chroma);
  const auto at = [&](int x, int y, int component) {
    const std::size_t pixel =
        as_size(std::min(y, height - 1)) * as_size(width) + as_size(std::min(x, width - 1));
    return int{samples[pixel * as_size(components) + as_size(component)]};
  };
  std::size_t out = 0;
  const int whole = chroma == ChromaStep::k444 ? components : 1;
  for (int component = 0; component < whole; ++component) {
    out = 0;
    for (int y = 0; y < planes.height; ++y) {
      for (int x = 0; x < planes.width; ++x) {
        planes.plane[as_size(component)][out++] = static_cast<std::uint8_t>(at(x, y, component));
      }
    }
  }
  for (int component = whole; component < components; ++component) {
    out = 0;
    for (int y = 0; y < planes.height; y += 2) {
      for (int x = 0; x < planes.width; x += 2) {
        const int sum = at(x, y, component) + at(x + 1, y, component) + at(x, y + 1, component) +
                        at(x + 1, y + 1, component);
        planes.plane[as_size(component)][out++] = static_cast<std::uint8_t>((sum + 2) / 4);
      }
    }
  }
  return planes;
}

ChromaStep chroma_of_jpeg(std::span<const std::byte> jpeg, std::string_view name) {
  libjpeg::Decompressor decompressor;
  jpeg_decompress_struct& info = decompressor.info;
  if (!libjpeg::guarded(decompressor.errors, [&] {
        decompressor.set_input(jpeg);
        jpeg_read_header(&info, TRUE);
      })) {
    libjpeg::throw_error(decompressor.errors, name);
  }
  bool is_whole = info.num_components == 3;
  for (int i = 0; i < info.num_components; ++i) {
    is_whole = is_whole && info.comp_info[i].h_samp_factor == info.max_h_samp_factor &&
               info.comp_info[i].v_samp_factor == info.max_v_samp_factor;
  }
  return is_whole ? ChromaStep::k444 : ChromaStep::k420;
}

std::vector<std::byte> jpeg_of_planes(const PlanesView& planes, int width, int height) {
  const int mcu = 8 * static_cast<int>(planes.chroma);
  const int padded_width = (width + mcu - 1) / mcu * mcu;
  // One row of MCUs at a time, its last columns and rows repeated.
  std::array<std::vector<std::uint8_t>, 3> rows;
  std::array<std::array<JSAMPROW, 16>, 3> row_pointers{};
  for (std::size_t c = 0; c < 3; ++c) {
    const int divisor = step_of(planes.chroma, c);
    rows[c].resize(as_size(padded_width / divisor) * as_size(mcu / divisor));
    for (int y = 0; y < mcu / divisor; ++y) {
      row_pointers[c][as_size(y)] = rows[c].data() + as_size(y) * as_size(padded_width / divisor);
    }
  }
  const auto fill = [&](int top) {
    for (std::size_t c = 0; c < 3; ++c) {
      const int divisor = step_of(planes.chroma, c);
      const int columns = (width + divisor - 1) / divisor;
      const int last_row = (height + divisor - 1) / divisor - 1;
      for (int y = 0; y < mcu / divisor; ++y) {
        const std::uint8_t* const source =
            planes.plane[c] + std::min(top / divisor + y, last_row) * planes.stride[c];
        std::uint8_t* const target = row_pointers[c][as_size(y)];
        std::copy_n(source, columns, target);
        std::fill(target + columns, target + padded_width / divisor, source[columns - 1]);
      }
    }
  };
  std::vector<std::byte> bytes;
  libjpeg::Compressor compressor;
  jpeg_compress_struct& info = compressor.info;
  libjpeg::VectorDestination destination(info, bytes);
  std::array<JSAMPARRAY, 3> pointers{row_pointers[0].data(), row_pointers[1].data(),
                                     row_pointers[2].data()};
  const bool encoded = libjpeg::guarded(compressor.errors, [&] {
    info.image_width = static_cast<JDIMENSION>(width);
    info.image_height = static_cast<JDIMENSION>(height);
    info.input_components = 3;
    info.in_color_space = JCS_YCbCr;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, 100, TRUE);  // all steps are 1
    info.dct_method = JDCT_ISLOW;
    info.comp_info[0].h_samp_factor = static_cast<int>(planes.chroma);
    info.comp_info[0].v_samp_factor = static_cast<int>(planes.chroma);
    info.raw_data_in = TRUE;
    info.restart_interval = static_cast<unsigned>(default_restart_interval(width, mcu));
    jpeg_start_compress(&info, TRUE);
    while (info.next_scanline < info.image_height) {
      fill(static_cast<int>(info.next_scanline));
      jpeg_write_raw_data(&info, pointers.data(), mcu);
    }
    jpeg_finish_compress(&info);
  });
  if (!encoded) libjpeg::throw_error(compressor.errors, "JPEG encoder");
  bytes.resize(destination.file().size());
  return bytes;
}

double mean_square_error(const Planes& a, const Planes& b, int width, int height) {
  double sum = 0, count = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const int divisor = step_of(a.chroma, c);
    const int stride = a.width / divisor;
    const int columns = (width + divisor - 1) / divisor, rows = (height + divisor - 1) / divisor;
    std::uint64_t squares = 0;
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns; ++x) {
        const std::size_t i = as_size(y) * as_size(stride) + as_size(x);
        const int difference = int{a.plane[c][i]} - int{b.plane[c][i]};
        squares += static_cast<std::uint64_t>(difference * difference);
      }
    }
    sum += static_cast<double>(squares);
    count += static_cast<double>(columns) * rows;
  }
  return sum / count;
}

}  // namespace raystage::store
