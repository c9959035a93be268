// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/pixel_conversion.h"

extern "C" {
#include <libavutil/opt.h>
}

#include <algorithm>
#include <optional>
#include <utility>

// Converts an AVFrame of any pixel format to a RawImage of the same width and height: 8 bits, full
// range and the Rec.601 matrix, as JPEG needs. Method: swscale with bilinear chroma, then a table
// for limited-range grey, which swscale takes as full range. Cost: one pass over the pixels and one
// new image, or nothing if the format already fits.

namespace raystage::ingest {
namespace {

/// Returns swscale's name of a format. Full range of YUV is a setting of the context.
AVPixelFormat av_format(store::PixelFormat format) {
  switch (format) {
    case store::PixelFormat::kYuv420:
      return AV_PIX_FMT_YUV420P;
    case store::PixelFormat::kYuv422:
      return AV_PIX_FMT_YUV422P;
    case store::PixelFormat::kYuv444:
      return AV_PIX_FMT_YUV444P;
    case store::PixelFormat::kGray:
      return AV_PIX_FMT_GRAY8;
    case store::PixelFormat::kBgr:
      return AV_PIX_FMT_BGR24;
    case store::PixelFormat::kRgb:
      break;
  }
  return AV_PIX_FMT_RGB24;
}

bool is_full_range(const AVFrame& picture) {
  for (const int full : {AV_PIX_FMT_YUVJ411P, AV_PIX_FMT_YUVJ420P, AV_PIX_FMT_YUVJ422P,
                         AV_PIX_FMT_YUVJ440P, AV_PIX_FMT_YUVJ444P}) {
    if (picture.format == full) return true;
  }
  const AVPixFmtDescriptor* description =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  const bool grey = description != nullptr && description->nb_components <= 2;
  return picture.color_range == AVCOL_RANGE_JPEG ||
         (grey && picture.color_range == AVCOL_RANGE_UNSPECIFIED);
}

/// Returns swscale's number of the picture's matrix, by default Rec.601.
int matrix_of(const AVFrame& picture) {
  switch (picture.colorspace) {
    case AVCOL_SPC_BT709:
      return SWS_CS_ITU709;
    case AVCOL_SPC_FCC:
      return SWS_CS_FCC;
    case AVCOL_SPC_SMPTE240M:
      return SWS_CS_SMPTE240M;
    case AVCOL_SPC_BT2020_NCL:
    case AVCOL_SPC_BT2020_CL:
      return SWS_CS_BT2020;
    default:
      return SWS_CS_ITU601;
  }
}

/// Returns the nearest format: of the same kind, with no less chroma resolution.
store::PixelFormat nearest_format(const AVPixFmtDescriptor& picture) {
  constexpr unsigned kNotYuv = AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BAYER;
  if ((picture.flags & kNotYuv) != 0) return store::PixelFormat::kRgb;
  if (picture.nb_components <= 2) return store::PixelFormat::kGray;
  if (picture.log2_chroma_w == 0) return store::PixelFormat::kYuv444;
  return picture.log2_chroma_h == 0 ? store::PixelFormat::kYuv422 : store::PixelFormat::kYuv420;
}

/// Returns the format of a picture that needs no conversion.
std::optional<store::PixelFormat> same_format(const AVFrame& picture) {
  for (const int stride : {picture.linesize[0], picture.linesize[1], picture.linesize[2]}) {
    if (stride < 0) return std::nullopt;  // bottom up
  }
  const auto known = [](store::PixelFormat format, bool fits) {
    return fits ? std::optional(format) : std::nullopt;
  };
  const bool jpeg_colour = is_full_range(picture) && matrix_of(picture) == SWS_CS_ITU601;
  switch (picture.format) {
    case AV_PIX_FMT_RGB24:
      return store::PixelFormat::kRgb;
    case AV_PIX_FMT_BGR24:
      return store::PixelFormat::kBgr;
    case AV_PIX_FMT_GRAY8:
      return known(store::PixelFormat::kGray, is_full_range(picture));
    case AV_PIX_FMT_YUV420P:
    case AV_PIX_FMT_YUVJ420P:
      return known(store::PixelFormat::kYuv420, jpeg_colour);
    case AV_PIX_FMT_YUV422P:
    case AV_PIX_FMT_YUVJ422P:
      return known(store::PixelFormat::kYuv422, jpeg_colour);
    case AV_PIX_FMT_YUV444P:
    case AV_PIX_FMT_YUVJ444P:
      return known(store::PixelFormat::kYuv444, jpeg_colour);
    default:
      return std::nullopt;
  }
}

/// Allocates a picture. Rows are aligned and padded for swscale's SIMD code.
store::RawImage new_image(store::PixelFormat format, int width, int height) {
  constexpr std::size_t kAlign = 64;
  store::RawImage image;
  image.format = format;
  image.width = width;
  image.height = height;
  std::array<std::size_t, 3> offset{};
  std::size_t total = 0;
  for (int plane = 0; plane < image.plane_count(); ++plane) {
    const std::size_t stride = (image.row_bytes(plane) + kAlign - 1) / kAlign * kAlign;
    image.planes[plane].stride = stride;
    offset[plane] = total;
    total += stride * static_cast<std::size_t>(image.rows(plane));
  }
  struct Memory {
    explicit Memory(std::size_t size)
        : data(static_cast<std::byte*>(::operator new (size, std::align_val_t{kAlign}))) {}
    ~Memory() { ::operator delete (data, std::align_val_t{kAlign}); }
    Memory(const Memory&) = delete;
    Memory& operator=(const Memory&) = delete;
    std::byte* data;
  };
  const auto memory = std::make_shared<const Memory>(total + kAlign);
  for (int plane = 0; plane < image.plane_count(); ++plane) {
    image.planes[plane].data = memory->data + offset[plane];
  }
  image.owner = memory;
  return image;
}

/// Stretches grey codes of 16 to 235 to 0 to 255.
void stretch_limited_range(std::uint8_t* data, std::size_t count) {
  std::array<std::uint8_t, 256> table{};
  for (int code = 0; code < 256; ++code) {
    table[code] = static_cast<std::uint8_t>(std::clamp(((code - 16) * 255 + 109) / 219, 0, 255));
  }
  for (std::size_t i = 0; i < count; ++i) data[i] = table[data[i]];
}

}  // namespace

bool PixelConverter::prepare(const Kind& kind) {
  if (scaler_ && kind == kind_) return true;
  scaler_.reset(check_allocation(sws_alloc_context()));
  SwsContext* scaler = scaler_.get();
  const auto set = [&](const char* name, int value) { av_opt_set_int(scaler, name, value, 0); };
  set("srcw", kind.width);
  set("srch", kind.height);
  set("src_format", kind.format);
  set("src_range", kind.full_range ? 1 : 0);
  set("dstw", kind.width);
  set("dsth", kind.height);
  set("dst_format", kind.target);
  set("dst_range", 1);
  set("sws_flags",
      SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP | SWS_BITEXACT);
  constexpr int kUnchanged = 1 << 16;  // contrast and saturation, 16.16 fixed point
  // Ranges are set before the context is built, so that it chooses no shortcut that ignores them.
  // The matrix can only be set after. The call fails for RGB to RGB, which has neither.
  if (sws_init_context(scaler, nullptr, nullptr) < 0) {
    scaler_.reset();
    return false;
  }
  sws_setColorspaceDetails(scaler, sws_getCoefficients(kind.matrix), kind.full_range ? 1 : 0,
                           sws_getCoefficients(SWS_CS_ITU601), 1, 0, kUnchanged, kUnchanged);
  kind_ = kind;
  return true;
}

bool PixelConverter::convert(const AVFrame& picture, std::shared_ptr<const void> owner,
                             store::RawImage& image) {
  image = {};
  if (const auto format = same_format(picture); format) {
    image.format = *format;
    image.width = picture.width;
    image.height = picture.height;
    for (std::size_t plane = 0; plane < image.planes.size(); ++plane) {
      if (picture.data[plane] == nullptr || picture.linesize[plane] == 0) break;
      image.planes[plane] = {reinterpret_cast<const std::byte*>(picture.data[plane]),
                             static_cast<std::size_t>(picture.linesize[plane])};
    }
    image.owner = std::move(owner);
    return true;
  }
  const AVPixFmtDescriptor* description =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  return description != nullptr && convert_to(nearest_format(*description), picture, image);
}

bool PixelConverter::convert_to(store::PixelFormat format, const AVFrame& picture,
                                store::RawImage& image) {
  image = {};
  if (picture.width <= 0 || picture.height <= 0) return false;
  if (!prepare({.width = picture.width,
                .height = picture.height,
                .format = picture.format,
                .target = av_format(format),
                .matrix = matrix_of(picture),
                .full_range = is_full_range(picture)})) {
    return false;
  }
  store::RawImage converted = new_image(format, picture.width, picture.height);
  std::array<std::uint8_t*, 4> data{};
  std::array<int, 4> stride{};
  for (std::size_t plane = 0; plane < converted.planes.size(); ++plane) {
    // The image has no other owner yet, so that writing is safe.
    data[plane] =
        reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(converted.planes[plane].data));
    stride[plane] = static_cast<int>(converted.planes[plane].stride);
  }
  const int rows = sws_scale(scaler_.get(), picture.data, picture.linesize, 0, picture.height,
                             data.data(), stride.data());
  if (rows != picture.height) return false;
  if (format == store::PixelFormat::kGray && !is_full_range(picture)) {
    stretch_limited_range(data[0],
                          converted.planes[0].stride * static_cast<std::size_t>(picture.height));
  }
  image = std::move(converted);
  return true;
}

}  // namespace raystage::ingest
