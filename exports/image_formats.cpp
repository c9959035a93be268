// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <stdexcept>
#include <string>

#include "exports/frame_exr.h"
#include "exports/image_format.h"
#include "images/png_file.h"

namespace raystage::exports {
namespace {

class JpegCopy : public ImageEncoder {
 public:
  std::vector<std::byte> encode(const SourceFrames::Ready& ready,
                                SourceFrames& /*source*/) override {
    return {ready.jpeg.begin(), ready.jpeg.end()};
  }
};

class PngEncoder : public ImageEncoder {
 public:
  std::vector<std::byte> encode(const SourceFrames::Ready& /*ready*/,
                                SourceFrames& source) override {
    return images::encode_png(source.picture(), source.counts().id);
  }
};

class JpegFormat : public ImageFormat {
 public:
  std::string_view name() const override { return "jpeg"; }
  std::string_view description() const override { return "the JPEG frames byte for byte"; }
  std::string_view extension() const override { return ".jpg"; }
  double estimated_bytes(double source_bytes, double /*pixels*/) const override {
    return source_bytes;
  }
  std::unique_ptr<ImageEncoder> open(const store::Take& /*take*/, int /*camera*/, double /*fps*/,
                                     const ExrExportOptions& /*exr*/) const override {
    return std::make_unique<JpegCopy>();
  }
};

class PngFormat : public ImageFormat {
 public:
  std::string_view name() const override { return "png"; }
  std::string_view description() const override {
    return "8-bit RGB, the codes that libjpeg-turbo decodes";
  }
  std::string_view extension() const override { return ".png"; }
  double estimated_bytes(double /*source_bytes*/, double pixels) const override {
    constexpr double kBytesPerPixel = 2;  // of 3 without compression
    return kBytesPerPixel * pixels;
  }
  std::unique_ptr<ImageEncoder> open(const store::Take& /*take*/, int /*camera*/, double /*fps*/,
                                     const ExrExportOptions& /*exr*/) const override {
    return std::make_unique<PngEncoder>();
  }
};

class ExrFormat : public ImageFormat {
 public:
  std::string_view name() const override { return "exr"; }
  std::string_view description() const override {
    return "scene-linear Rec.709 by the camera's photometric response, half; time, pose and lens "
           "in "
           "the header";
  }
  std::string_view extension() const override { return ".exr"; }
  std::string color_space(const store::Take& /*take*/) const override { return "lin_rec709_scene"; }
  bool keeps_deep_pictures() const override { return true; }
  double estimated_bytes(double /*source_bytes*/, double pixels) const override {
    constexpr double kBytesPerPixel = 4;  // of 6 without compression
    return kBytesPerPixel * pixels;
  }
  std::unique_ptr<ImageEncoder> open(const store::Take& take, int camera, double fps,
                                     const ExrExportOptions& exr) const override {
    return std::make_unique<FrameExrEncoder>(take, camera, fps, exr);
  }
};

}  // namespace

std::span<const ImageFormat* const> image_formats() {
  static const JpegFormat kJpeg;
  static const PngFormat kPng;
  static const ExrFormat kExr;
  static const std::array<const ImageFormat*, 3> kFormats{&kJpeg, &kPng, &kExr};
  return kFormats;
}

const ImageFormat& image_format(std::string_view name) {
  for (const ImageFormat* format : image_formats()) {
    if (format->name() == name) return *format;
  }
  throw std::logic_error("there is no image format of this name: " + std::string(name));
}

}  // namespace raystage::exports
