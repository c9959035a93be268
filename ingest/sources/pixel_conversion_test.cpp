// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/pixel_conversion.h"

#include <gtest/gtest.h>

extern "C" {
#include <libavutil/frame.h>
}

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

namespace raystage::ingest {
namespace {

constexpr int kWidth = 38, kHeight = 26;

/// Weights of red and blue in luma.
struct Matrix {
  double red, blue;
};
constexpr Matrix kRec601{0.299, 0.114}, kRec709{0.2126, 0.0722};

using Triple = std::array<double, 3>;

/// Converts Y'CbCr codes to R'G'B' codes by the definition: the reference.
Triple rgb_from(const Triple& code, const Matrix& m, bool full) {
  const double y = full ? code[0] / 255 : (code[0] - 16) / 219;
  const double cb = (code[1] - 128) / (full ? 255 : 224);
  const double cr = (code[2] - 128) / (full ? 255 : 224);
  const double r = y + 2 * (1 - m.red) * cr, b = y + 2 * (1 - m.blue) * cb;
  return {r, (y - m.red * r - m.blue * b) / (1 - m.red - m.blue), b};
}

Triple full_601_from(const Triple& rgb) {
  const double y =
      kRec601.red * rgb[0] + kRec601.blue * rgb[2] + (1 - kRec601.red - kRec601.blue) * rgb[1];
  return {255 * y, 128 + 255 * (rgb[2] - y) / (2 * (1 - kRec601.blue)),
          128 + 255 * (rgb[0] - y) / (2 * (1 - kRec601.red))};
}

AvPtr<AVFrame> new_frame(AVPixelFormat format, AVColorRange range, AVColorSpace matrix) {
  AvPtr<AVFrame> frame(check_allocation(av_frame_alloc()));
  frame->width = kWidth;
  frame->height = kHeight;
  frame->format = format;
  frame->color_range = range;
  frame->colorspace = matrix;
  EXPECT_EQ(av_frame_get_buffer(frame.get(), 0), 0);
  return frame;
}

void fill(AVFrame& frame, const std::array<int, 3>& code) {
  const AVPixFmtDescriptor& d = *av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  for (int c = 0; c < d.nb_components; ++c) {
    const bool chroma = c > 0 && (d.flags & AV_PIX_FMT_FLAG_RGB) == 0;
    const int w = chroma ? -((-kWidth) >> d.log2_chroma_w) : kWidth;
    const int h = chroma ? -((-kHeight) >> d.log2_chroma_h) : kHeight;
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        frame.data[d.comp[c].plane][y * frame.linesize[d.comp[c].plane] + x * d.comp[c].step +
                                    d.comp[c].offset] = static_cast<std::uint8_t>(code[c]);
      }
    }
  }
}

int code_at(const store::RawImage& image, std::size_t plane, int x, int y) {
  const store::RawImage::Plane& p = image.planes[plane];
  return std::to_integer<int>(
      p.data[static_cast<std::size_t>(y) * p.stride + static_cast<std::size_t>(x)]);
}

struct YuvCase {
  AVPixelFormat format;
  AVColorRange range;
  AVColorSpace matrix;
  store::PixelFormat expected;
};
void PrintTo(const YuvCase& c, std::ostream* stream) {
  *stream << av_get_pix_fmt_name(c.format) << " range " << c.range << " matrix " << c.matrix;
}

class YuvConversion : public ::testing::TestWithParam<YuvCase> {};

TEST_P(YuvConversion, AgreesWithTheDefinition) {
  const YuvCase& c = GetParam();
  const auto frame = new_frame(c.format, c.range, c.matrix);
  PixelConverter converter;
  for (const std::array<int, 3>& code : {std::array<int, 3>{16, 128, 128},
                                         {235, 128, 128},
                                         {120, 128, 128},
                                         {100, 110, 150},
                                         {140, 160, 100},
                                         {90, 100, 120}}) {
    fill(*frame, code);
    store::RawImage image;
    ASSERT_TRUE(converter.convert(*frame, nullptr, image));
    EXPECT_EQ(image.format, c.expected);
    EXPECT_EQ(image.width, kWidth);
    EXPECT_EQ(image.height, kHeight);
    const Triple shown =
        rgb_from({1.0 * code[0], 1.0 * code[1], 1.0 * code[2]},
                 c.matrix == AVCOL_SPC_BT709 ? kRec709 : kRec601, c.range == AVCOL_RANGE_JPEG);
    const Triple expected = full_601_from(shown);
    for (std::size_t plane = 0; plane < 3; ++plane) {
      const double wanted = std::clamp(expected[plane], 0.0, 255.0);
      // If the matrix changes, swscale converts through 8-bit RGB, which rounds once more.
      const double most = c.matrix == AVCOL_SPC_BT709 ? 2.01 : 1.01;
      EXPECT_NEAR(code_at(image, plane, 7, 5), wanted, most)
          << "plane " << plane << " of " << code[0] << " " << code[1] << " " << code[2];
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Formats, YuvConversion,
    ::testing::Values(
        YuvCase{AV_PIX_FMT_YUV420P, AVCOL_RANGE_JPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv420},
        YuvCase{AV_PIX_FMT_YUV420P, AVCOL_RANGE_MPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv420},
        YuvCase{AV_PIX_FMT_YUV420P, AVCOL_RANGE_UNSPECIFIED, AVCOL_SPC_SMPTE170M,
                store::PixelFormat::kYuv420},
        YuvCase{AV_PIX_FMT_YUV420P, AVCOL_RANGE_MPEG, AVCOL_SPC_BT709, store::PixelFormat::kYuv420},
        YuvCase{AV_PIX_FMT_YUV420P, AVCOL_RANGE_JPEG, AVCOL_SPC_BT709, store::PixelFormat::kYuv420},
        YuvCase{AV_PIX_FMT_YUV422P, AVCOL_RANGE_JPEG, AVCOL_SPC_BT470BG,
                store::PixelFormat::kYuv422},
        YuvCase{AV_PIX_FMT_YUV444P, AVCOL_RANGE_JPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv444},
        YuvCase{AV_PIX_FMT_YUV444P, AVCOL_RANGE_MPEG, AVCOL_SPC_BT709, store::PixelFormat::kYuv444},
        YuvCase{AV_PIX_FMT_YUYV422, AVCOL_RANGE_MPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv422},
        YuvCase{AV_PIX_FMT_YUYV422, AVCOL_RANGE_JPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv422},
        YuvCase{AV_PIX_FMT_UYVY422, AVCOL_RANGE_JPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv422},
        YuvCase{AV_PIX_FMT_NV12, AVCOL_RANGE_MPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv420},
        YuvCase{AV_PIX_FMT_YUV411P, AVCOL_RANGE_MPEG, AVCOL_SPC_UNSPECIFIED,
                store::PixelFormat::kYuv422}));

TEST(PixelConverter, WhatIsOursAlreadyIsNotCopied) {
  PixelConverter converter;
  const auto owner = std::make_shared<int>(0);
  for (const AVPixelFormat format : {AV_PIX_FMT_YUVJ420P, AV_PIX_FMT_YUVJ422P, AV_PIX_FMT_YUVJ444P,
                                     AV_PIX_FMT_GRAY8, AV_PIX_FMT_RGB24, AV_PIX_FMT_BGR24}) {
    const auto frame = new_frame(format, AVCOL_RANGE_UNSPECIFIED, AVCOL_SPC_UNSPECIFIED);
    store::RawImage image;
    ASSERT_TRUE(converter.convert(*frame, owner, image));
    EXPECT_EQ(static_cast<const void*>(image.planes[0].data), frame->data[0]);
    EXPECT_EQ(image.owner, owner);
    EXPECT_EQ(owner.use_count(), 2);
  }
}

TEST(PixelConverter, PicturesThatStandOnTheirHeadsAreTurned) {
  const auto frame = new_frame(AV_PIX_FMT_GRAY8, AVCOL_RANGE_JPEG, AVCOL_SPC_UNSPECIFIED);
  fill(*frame, {10, 0, 0});
  frame->data[0][0] = 200;
  frame->data[0] += (kHeight - 1) * frame->linesize[0];
  frame->linesize[0] = -frame->linesize[0];
  PixelConverter converter;
  store::RawImage image;
  const bool converted = converter.convert(*frame, nullptr, image);
  frame->linesize[0] = -frame->linesize[0];
  ASSERT_TRUE(converted);
  EXPECT_EQ(code_at(image, 0, 0, kHeight - 1), 200);
  EXPECT_EQ(code_at(image, 0, 0, 0), 10);
}

TEST(PixelConverter, LimitedGreyIsStretched) {
  const auto frame = new_frame(AV_PIX_FMT_GRAY8, AVCOL_RANGE_MPEG, AVCOL_SPC_UNSPECIFIED);
  PixelConverter converter;
  store::RawImage image;
  for (const auto& [code, expected] : {std::pair{16, 0}, {235, 255}, {126, 128}}) {
    fill(*frame, {code, 0, 0});
    ASSERT_TRUE(converter.convert(*frame, nullptr, image));
    EXPECT_EQ(image.format, store::PixelFormat::kGray);
    EXPECT_NEAR(code_at(image, 0, 3, 3), expected, 1);
  }
}

TEST(PixelConverter, BayerPatternsBecomeRgb) {
  struct Pattern {
    AVPixelFormat format;
    std::array<int, 4> channel;  // of the 2x2 block by rows
  };
  for (const Pattern& pattern : {Pattern{AV_PIX_FMT_BAYER_RGGB8, {0, 1, 1, 2}},
                                 Pattern{AV_PIX_FMT_BAYER_BGGR8, {2, 1, 1, 0}},
                                 Pattern{AV_PIX_FMT_BAYER_GRBG8, {1, 0, 2, 1}},
                                 Pattern{AV_PIX_FMT_BAYER_GBRG8, {1, 2, 0, 1}}}) {
    const auto frame = new_frame(pattern.format, AVCOL_RANGE_UNSPECIFIED, AVCOL_SPC_UNSPECIFIED);
    const std::array<int, 3> colour{200, 120, 40};
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const int channel = pattern.channel[2 * (y % 2) + x % 2];
        frame->data[0][y * frame->linesize[0] + x] = static_cast<std::uint8_t>(colour[channel]);
      }
    }
    PixelConverter converter;
    store::RawImage image;
    ASSERT_TRUE(converter.convert(*frame, nullptr, image));
    ASSERT_EQ(image.format, store::PixelFormat::kRgb);
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_EQ(code_at(image, 0, 3 * 9 + channel, 9), colour[channel])
          << av_get_pix_fmt_name(pattern.format) << " channel " << channel;
    }
  }
}

TEST(PixelConverter, RgbBecomesFullRangeYuvOnRequest) {
  const auto frame = new_frame(AV_PIX_FMT_RGB24, AVCOL_RANGE_UNSPECIFIED, AVCOL_SPC_UNSPECIFIED);
  PixelConverter converter;
  for (const std::array<int, 3>& rgb :
       {std::array<int, 3>{0, 0, 0}, {255, 255, 255}, {200, 100, 50}, {10, 60, 220}}) {
    fill(*frame, rgb);
    store::RawImage image;
    ASSERT_TRUE(converter.convert_to(store::PixelFormat::kYuv420, *frame, image));
    const Triple expected = full_601_from({rgb[0] / 255.0, rgb[1] / 255.0, rgb[2] / 255.0});
    for (std::size_t plane = 0; plane < 3; ++plane) {
      EXPECT_NEAR(code_at(image, plane, 4, 4), expected[plane], 1.01);
    }
  }
}

TEST(PixelConverter, UnknownFormatsAreRefused) {
  AVFrame* frame = av_frame_alloc();
  frame->width = frame->height = 8;
  frame->format = AV_PIX_FMT_NONE;
  PixelConverter converter;
  store::RawImage image;
  EXPECT_FALSE(converter.convert(*frame, nullptr, image));
  EXPECT_EQ(image.planes[0].data, nullptr);
  av_frame_free(&frame);
}

}  // namespace
}  // namespace raystage::ingest
