// SPDX-License-Identifier: Apache-2.0
// Encodes grey, RGB, BGR and planar YUV frames as JPEG with libjpeg-turbo, without intermediate
// pictures. YUV planes go to the encoder as raw data (jpeg_write_raw_data): no colour conversion
// and no chroma resampling. Only rows that do not fill whole MCUs are copied. One encoder and its
// buffers serve all frames of a camera.
#include "store/jpeg/raw_encoder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <string>

#include "base/error.h"
#include "base/options.h"
#include "store/jpeg/libjpeg.h"

namespace raystage::store {
namespace {

constexpr int kMaxSide = 65500;

J_COLOR_SPACE color_space_of(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGray:
      return JCS_GRAYSCALE;
    case PixelFormat::kRgb:
      return JCS_EXT_RGB;
    case PixelFormat::kBgr:
      return JCS_EXT_BGR;
    case PixelFormat::kYuv420:
    case PixelFormat::kYuv422:
    case PixelFormat::kYuv444:
      break;
  }
  return JCS_YCbCr;
}

void check(const RawImage& image) {
  if (image.width < 1 || image.height < 1 || image.width > kMaxSide || image.height > kMaxSide) {
    throw Error::bad_input("a JPEG cannot have a size of " + std::to_string(image.width) + "x" +
                               std::to_string(image.height),
                           "", "Use 1-65500 pixels per side");
  }
  for (int plane = 0; plane < image.plane_count(); ++plane) {
    assert(image.planes[static_cast<std::size_t>(plane)].data != nullptr);
    assert(image.planes[static_cast<std::size_t>(plane)].stride >= image.row_bytes(plane));
  }
}

}  // namespace

struct RawJpegEncoder::State {
  explicit State(const JpegEncodeOptions& encode_options) : options(encode_options) {}

  void start(const RawImage& image);
  void write_rows(const RawImage& image);
  void write_planes(const RawImage& image);
  JSAMPROW padded_row(const RawImage& image, int plane, int row, std::size_t width,
                      std::size_t slot);

  JpegEncodeOptions options;
  libjpeg::Compressor compressor;
  std::vector<std::byte> room;  // the output buffer
  // Rows shorter than whole MCUs are copied here and their last sample is repeated, as libjpeg
  // reads whole MCUs.
  std::array<std::vector<std::byte>, 3> padding;
};

void RawJpegEncoder::State::start(const RawImage& image) {
  jpeg_compress_struct& info = compressor.info;
  info.image_width = static_cast<JDIMENSION>(image.width);
  info.image_height = static_cast<JDIMENSION>(image.height);
  info.input_components = image.format == PixelFormat::kGray ? 1 : 3;
  info.in_color_space = color_space_of(image.format);
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, options.quality, TRUE);
  info.dct_method = JDCT_ISLOW;
  int horizontal = 1, vertical = 1;
  if (is_yuv(image.format)) {
    horizontal = halves_chroma_width(image.format) ? 2 : 1;
    vertical = image.format == PixelFormat::kYuv420 ? 2 : 1;
  } else if (image.format != PixelFormat::kGray) {
    horizontal = options.chroma == JpegEncodeOptions::Chroma::k444 ? 1 : 2;
    vertical = options.chroma == JpegEncodeOptions::Chroma::k420 ? 2 : 1;
  }
  info.comp_info[0].h_samp_factor = horizontal;
  info.comp_info[0].v_samp_factor = vertical;
  info.restart_interval = static_cast<unsigned>(
      options.restart_interval >= 0 ? options.restart_interval
                                    : default_restart_interval(image.width, 8 * horizontal));
  info.raw_data_in = is_yuv(image.format) ? TRUE : FALSE;
  jpeg_start_compress(&info, TRUE);
}

void RawJpegEncoder::State::write_rows(const RawImage& image) {
  jpeg_compress_struct& info = compressor.info;
  while (info.next_scanline < info.image_height) {
    const std::byte* row = image.planes[0].data + info.next_scanline * image.planes[0].stride;
    // libjpeg only reads through this non-const pointer.
    auto* samples = reinterpret_cast<JSAMPROW>(const_cast<std::byte*>(row));
    jpeg_write_scanlines(&info, &samples, 1);
  }
}

JSAMPROW RawJpegEncoder::State::padded_row(const RawImage& image, int plane, int row,
                                           std::size_t width, std::size_t slot) {
  const RawImage::Plane& from = image.planes[plane];
  const int last = image.rows(plane) - 1;
  const std::byte* source = from.data + static_cast<std::size_t>(std::min(row, last)) * from.stride;
  const std::size_t bytes = image.row_bytes(plane);
  if (bytes == width) return reinterpret_cast<JSAMPROW>(const_cast<std::byte*>(source));
  std::byte* copy = padding[plane].data() + slot * width;
  std::memcpy(copy, source, bytes);
  std::fill(copy + bytes, copy + width, source[bytes - 1]);
  return reinterpret_cast<JSAMPROW>(copy);
}

void RawJpegEncoder::State::write_planes(const RawImage& image) {
  constexpr std::size_t kMaxRows = 16;  // of an MCU
  jpeg_compress_struct& info = compressor.info;
  std::array<std::array<JSAMPROW, kMaxRows>, 3> rows{};
  std::array<JSAMPARRAY, 3> planes{};
  std::array<std::size_t, 3> widths{};
  const int mcu_rows = info.comp_info[0].v_samp_factor * DCTSIZE;
  const int mcus = (image.width + info.comp_info[0].h_samp_factor * DCTSIZE - 1) /
                   (info.comp_info[0].h_samp_factor * DCTSIZE);
  for (std::size_t p = 0; p < 3; ++p) {
    planes[p] = rows[p].data();
    widths[p] = static_cast<std::size_t>(mcus * info.comp_info[p].h_samp_factor * DCTSIZE);
  }
  while (info.next_scanline < info.image_height) {
    for (std::size_t p = 0; p < 3; ++p) {
      const int count = info.comp_info[p].v_samp_factor * DCTSIZE;
      const int first = static_cast<int>(info.next_scanline) / mcu_rows * count;
      for (int r = 0; r < count; ++r) {
        rows[p][r] = padded_row(image, static_cast<int>(p), first + r, widths[p],
                                static_cast<std::size_t>(r));
      }
    }
    jpeg_write_raw_data(&info, planes.data(), static_cast<JDIMENSION>(mcu_rows));
  }
}

RawJpegEncoder::RawJpegEncoder(const JpegEncodeOptions& options)
    : state_(std::make_unique<State>(options)) {
  require_valid(options, "JPEG options");
}
RawJpegEncoder::~RawJpegEncoder() = default;
RawJpegEncoder::RawJpegEncoder(RawJpegEncoder&&) noexcept = default;
RawJpegEncoder& RawJpegEncoder::operator=(RawJpegEncoder&&) noexcept = default;

void RawJpegEncoder::encode(const RawImage& image, std::vector<std::byte>& bytes) {
  check(image);
  State& state = *state_;
  if (is_yuv(image.format)) {
    // Allocated outside of guarded(), as longjmp runs no destructors. Two MCUs are wide enough.
    for (int plane = 0; plane < 3; ++plane) {
      state.padding[plane].resize(16 * (image.row_bytes(plane) + 16));
    }
  }
  libjpeg::VectorDestination destination(state.compressor.info, state.room);
  const bool encoded = libjpeg::guarded(state.compressor.errors, [&] {
    state.start(image);
    if (is_yuv(image.format)) {
      state.write_planes(image);
    } else {
      state.write_rows(image);
    }
    jpeg_finish_compress(&state.compressor.info);
  });
  if (encoded) {
    const auto file = destination.file();
    bytes.assign(file.begin(), file.end());
    return;
  }
  jpeg_abort_compress(&state.compressor.info);
  libjpeg::throw_error(state.compressor.errors, "JPEG encoder");
}

}  // namespace raystage::store
