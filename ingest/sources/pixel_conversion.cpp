// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/pixel_conversion.h"

extern "C" {
#include <libavutil/opt.h>
}

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

namespace raystage {
namespace {

/// What swscale calls our formats; YUV there is full range by the context's setting.
AVPixelFormat av_format(PixelFormat format) {
  switch (format) {
    case PixelFormat::kYuv420:
      return AV_PIX_FMT_YUV420P;
    case PixelFormat::kYuv422:
      return AV_PIX_FMT_YUV422P;
    case PixelFormat::kYuv444:
      return AV_PIX_FMT_YUV444P;
    case PixelFormat::kGray:
      return AV_PIX_FMT_GRAY8;
    case PixelFormat::kBgr:
      return AV_PIX_FMT_BGR24;
    case PixelFormat::kRgb:
      break;
  }
  return AV_PIX_FMT_RGB24;
}

bool is_full_range(const AVFrame& picture) {
  switch (picture.format) {
    case AV_PIX_FMT_YUVJ411P:
    case AV_PIX_FMT_YUVJ420P:
    case AV_PIX_FMT_YUVJ422P:
    case AV_PIX_FMT_YUVJ440P:
    case AV_PIX_FMT_YUVJ444P:
      return true;
    default:
      break;
  }
  const AVPixFmtDescriptor* description =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(picture.format));
  const bool grey = description != nullptr && description->nb_components <= 2;
  return picture.color_range == AVCOL_RANGE_JPEG ||
         (grey && picture.color_range == AVCOL_RANGE_UNSPECIFIED);
}

/// swscale's number of the matrix; all that are Rec.601 are one.
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

/// Ours that is nearest: of the same kind, with no less chroma than the picture has.
PixelFormat nearest_format(const AVPixFmtDescriptor& picture) {
  constexpr unsigned kNotYuv = AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BAYER;
  if ((picture.flags & kNotYuv) != 0) return PixelFormat::kRgb;
  if (picture.nb_components <= 2) return PixelFormat::kGray;
  if (picture.log2_chroma_w == 0) return PixelFormat::kYuv444;
  return picture.log2_chroma_h == 0 ? PixelFormat::kYuv422 : PixelFormat::kYuv420;
}

/// Our format where the picture's bytes are just that.
std::optional<PixelFormat> same_format(const AVFrame& picture) {
  for (const int stride : {picture.linesize[0], picture.linesize[1], picture.linesize[2]}) {
    if (stride < 0) return std::nullopt;  // bottom up
  }
  const bool jpeg_colour = is_full_range(picture) && matrix_of(picture) == SWS_CS_ITU601;
  switch (picture.format) {
    case AV_PIX_FMT_RGB24:
      return PixelFormat::kRgb;
    case AV_PIX_FMT_BGR24:
      return PixelFormat::kBgr;
    case AV_PIX_FMT_GRAY8:
      if (is_full_range(picture)) return PixelFormat::kGray;
      return std::nullopt;
    case AV_PIX_FMT_YUV420P:
    case AV_PIX_FMT_YUVJ420P:
      if (jpeg_colour) return PixelFormat::kYuv420;
      return std::nullopt;
    case AV_PIX_FMT_YUV422P:
    case AV_PIX_FMT_YUVJ422P:
      if (jpeg_colour) return PixelFormat::kYuv422;
      return std::nullopt;
    case AV_PIX_FMT_YUV444P:
    case AV_PIX_FMT_YUVJ444P:
      if (jpeg_colour) return PixelFormat::kYuv444;
      return std::nullopt;
    default:
      return std::nullopt;
  }
}

/// Memory for a picture; rows are aligned and padded as swscale's SIMD code wants them.
RawImage new_image(PixelFormat format, int width, int height) {
  constexpr std::size_t kAlign = 64;
  RawImage image;
  image.format = format;
  image.width = width;
  image.height = height;
  const bool yuv = format == PixelFormat::kYuv420 || format == PixelFormat::kYuv422 ||
                   format == PixelFormat::kYuv444;
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  const std::size_t chroma_w = format == PixelFormat::kYuv444 ? w : (w + 1) / 2;
  const std::size_t chroma_h = format == PixelFormat::kYuv420 ? (h + 1) / 2 : h;
  const std::size_t row = yuv || format == PixelFormat::kGray ? w : 3 * w;
  std::array<std::size_t, 3> offset{};
  std::size_t total = 0;
  for (std::size_t plane = 0; plane < (yuv ? 3U : 1U); ++plane) {
    const std::size_t bytes = plane == 0 ? row : chroma_w;
    image.planes[plane].stride = (bytes + kAlign - 1) / kAlign * kAlign;
    offset[plane] = total;
    total += image.planes[plane].stride * (plane == 0 ? h : chroma_h);
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
  for (std::size_t plane = 0; plane < (yuv ? 3U : 1U); ++plane) {
    image.planes[plane].data = memory->data + offset[plane];
  }
  image.owner = memory;
  return image;
}

/// swscale takes all grey as full range.
void stretch_limited_range(std::uint8_t* data, std::size_t count) {
  std::array<std::uint8_t, 256> table{};
  for (int code = 0; code < 256; ++code) {
    table[static_cast<std::size_t>(code)] =
        static_cast<std::uint8_t>(std::clamp(((code - 16) * 255 + 109) / 219, 0, 255));
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
  // The colours are set before the context is built and after: before, so that it takes no short
  // cut that knows no range; after, as the matrix can be set no earlier. Refused for RGB to RGB,
  // which has neither.
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
                             RawImage& image) {
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

bool PixelConverter::convert_to(PixelFormat format, const AVFrame& picture, RawImage& image) {
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
  RawImage converted = new_image(format, picture.width, picture.height);
  std::array<std::uint8_t*, 4> data{};
  std::array<int, 4> stride{};
  for (std::size_t plane = 0; plane < converted.planes.size(); ++plane) {
    // Ours alone as yet, so that it may be written.
    data[plane] =
        reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(converted.planes[plane].data));
    stride[plane] = static_cast<int>(converted.planes[plane].stride);
  }
  const int rows = sws_scale(scaler_.get(), picture.data, picture.linesize, 0, picture.height,
                             data.data(), stride.data());
  if (rows != picture.height) return false;
  if (format == PixelFormat::kGray && !is_full_range(picture)) {
    stretch_limited_range(data[0],
                          converted.planes[0].stride * static_cast<std::size_t>(picture.height));
  }
  image = std::move(converted);
  return true;
}

}  // namespace raystage
