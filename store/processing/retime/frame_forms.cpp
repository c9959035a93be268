// SPDX-License-Identifier: Apache-2.0
// Frames of a retimed take. JPEGs are blended code by code and encoded anew. Pictures of more than
// 8 bits become 65536 levels of light on the scale on which renderings are blended (blend_space.h),
// as in FrameCache, and are stored without loss in the form of their source: samples are not
// clipped at white. Each conversion is a table of 65536 entries.
#include "store/processing/retime/frame_forms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "store/jpeg/encode.h"
#include "store/jpegxl/picture_codec.h"
#include "store/pixel_light.h"
#include "store/processing/frames/blend_space.h"
#include "store/processing/frames/flow_luma.h"

namespace raystage::store {
namespace {

constexpr std::uint16_t kFullLevel = 65535;

class JpegFrames final : public FrameForm {
 public:
  JpegFrames(const ArchiveReader& archive, std::string name, int quality)
      : archive_(archive), name_(std::move(name)), quality_(quality) {}

  FrameBytes unchanged(int frame) const override { return archive_.jpeg(frame); }
  MovableFrame read(int frame) override {
    return {make_flow_image(
        decoder_.decode(archive_.jpeg(frame), fmt::format("{}, frame {}", name_, frame)))};
  }
  std::vector<std::byte> blend(const MovableFrame& a, const MovableFrame& b,
                               double part) const override {
    return encoded(store::blend(a.image.rgb, b.image.rgb, part));
  }
  std::vector<std::byte> interpolate(const MovableFrame& a, const MovableFrame& b,
                                     const std::array<FlowField, 2>& motion,
                                     const InstantBetween& instant) const override {
    return encoded(interpolate_frame(a.image, b.image, motion[0], motion[1], instant));
  }

 private:
  std::vector<std::byte> encoded(const RgbImage& image) const {
    JpegEncodeOptions encode;
    encode.quality = quality_;
    return encode_jpeg(image, encode);
  }

  const ArchiveReader& archive_;
  std::string name_;
  int quality_;
  JpegDecoder decoder_;
};

class PictureFrames final : public FrameForm {
 public:
  PictureFrames(const ArchiveReader& archive, const PictureCodec& codec,
                const schemas::PixelEncoding& encoding, std::string name)
      : archive_(archive), codec_(codec), encoding_(encoding), name_(std::move(name)) {
    const CodeScale scale{encoding.peak > 1 ? BlendSpace::kHighRange : BlendSpace::kPerceptual,
                          std::max(1.0, encoding.peak)};
    codes_ = flow_codes(scale);
    level_of_sample_.resize(kSampleValues);
    sample_of_level_.resize(kSampleValues);
    for (std::size_t i = 0; i < kSampleValues; ++i) {
      const double light = light_from_sample(encoding, static_cast<std::uint16_t>(i));
      const double part = std::clamp(light / scale.full_scale, 0.0, 1.0);
      level_of_sample_[i] =
          static_cast<std::uint16_t>(std::lround(kFullLevel * value_from_part(scale.space, part)));
      const double value = static_cast<double>(i) / kFullLevel;
      sample_of_level_[i] = sample_from_light(
          encoding,
          std::min(encoding.peak, scale.full_scale * part_from_value(scale.space, value)));
    }
  }

  FrameBytes unchanged(int frame) const override { return archive_.stored(frame); }
  MovableFrame read(int frame) override {
    const DeepPicture picture = archive_.picture(frame);
    const std::size_t pixels = picture.samples.size() / 3;
    MovableFrame read;
    read.levels.resize(4 * pixels, kFullLevel);
    for (std::size_t i = 0; i < pixels; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        read.levels[4 * i + c] = level_of_sample_[picture.samples[3 * i + c]];
      }
    }
    read.image.luma = flow_luma(read.levels, picture.width, picture.height, codes_);
    return read;
  }
  std::vector<std::byte> blend(const MovableFrame& a, const MovableFrame& b,
                               double part) const override {
    std::vector<std::uint16_t> levels(a.levels.size());
    for (std::size_t i = 0; i < levels.size(); ++i) {
      levels[i] =
          static_cast<std::uint16_t>(std::lround(std::lerp(a.levels[i], b.levels[i], part)));
    }
    return encoded(levels, a.image.luma);
  }
  std::vector<std::byte> interpolate(const MovableFrame& a, const MovableFrame& b,
                                     const std::array<FlowField, 2>& motion,
                                     const InstantBetween& instant) const override {
    std::vector<std::uint16_t> levels(a.levels.size());
    interpolate_levels({a.image.luma, b.image.luma, motion[0], motion[1]}, instant, a.levels,
                       b.levels, levels);
    return encoded(levels, a.image.luma);
  }

 private:
  std::vector<std::byte> encoded(const std::vector<std::uint16_t>& levels, const Luma& size) const {
    DeepPicture picture{size.width, size.height, {}};
    picture.samples.resize(levels.size() / 4 * 3);
    for (std::size_t i = 0; i < picture.samples.size(); ++i) {
      picture.samples[i] = sample_of_level_[levels[i / 3 * 4 + i % 3]];
    }
    return codec_.encode(picture, encoding_, {}, name_);
  }

  const ArchiveReader& archive_;
  const PictureCodec& codec_;
  schemas::PixelEncoding encoding_;
  std::string name_;
  std::vector<std::uint8_t> codes_;
  std::vector<std::uint16_t> level_of_sample_, sample_of_level_;
};

}  // namespace

std::unique_ptr<FrameForm> frame_form_of(const Take& take, int camera, std::string name,
                                         int quality) {
  const ArchiveReader& archive = take.archive(camera);
  const auto& pixels = take.document().cameras[static_cast<std::size_t>(camera)].pixels;
  if (!pixels) return std::make_unique<JpegFrames>(archive, std::move(name), quality);
  return std::make_unique<PictureFrames>(archive, take.unpacked_frames().pictures(), *pixels,
                                         std::move(name));
}

}  // namespace raystage::store
