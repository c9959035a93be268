// SPDX-License-Identifier: Apache-2.0
// Converts frames to scene-linear light. Codes pass the photometric correction of the renderer
// (store/processing/frames) at 16 bits on the sRGB curve, which resolves dark tones, then a table
// of 65536 linear values. Cost: JPEG decoding, a table per value, ZIP.
#include "exports/frame_exr.h"

#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <cmath>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/frame_rate.h"
#include "compose/exr/scanline_file.h"
#include "render/common/view.h"
#include "schemas/rig_document.h"
#include "store/pixel_light.h"
#include "store/processing/frames/blend_space.h"

namespace raystage::exports {
namespace {

constexpr std::size_t kLevels = 65536;

rig::PictureSize size_of(const store::Take& take, int camera) {
  const rig::CameraModel& model = take.rig().cameras[camera].model;
  return {model.width(), model.height()};
}

store::CodeScale scale_of(const store::Take& take, int camera) {
  const schemas::PhotometricResponse& response = take.rig().cameras[camera].photometric;
  if (const auto& pixels = take.document().cameras[camera].pixels) {
    return {store::BlendSpace::kHighRange,
            store::max_linear_light(response, size_of(take, camera), *pixels)};
  }
  return {store::BlendSpace::kPerceptual,
          store::max_linear_light(response, size_of(take, camera), take.document())};
}

store::PhotometricCorrection correction_of(const store::Take& take, int camera) {
  const schemas::PhotometricResponse& response = take.rig().cameras[camera].photometric;
  const store::CodeScale scale = scale_of(take, camera);
  if (const auto& pixels = take.document().cameras[camera].pixels) {
    return {response, size_of(take, camera), *pixels, scale};
  }
  return {response, size_of(take, camera), take.document(), scale};
}

compose::ExrMetadata metadata_of(const store::Take& take, double fps,
                                 const ExrExportOptions& options) {
  compose::ExrMetadata metadata;
  const FrameRate rate = frame_rate_from(std::round(fps * 1e6) / 1e6).value_or(FrameRate{});
  metadata.fps_numerator = rate.numerator;
  metadata.fps_denominator = rate.denominator;
  metadata.take_name = take.document().name;
  metadata.compression = options.compression;
  metadata.program_version = options.program_version;
  metadata.color_interop_id = options.color.interop_id;
  metadata.color_space = options.color.space;
  metadata.color_config = options.color.config;
  return metadata;
}

compose::ExrCamera camera_of(const rig::Rig::Camera& camera) {
  compose::ExrCamera result;
  result.view.width = camera.model.width();
  result.view.height = camera.model.height();
  result.view.intrinsics = camera.model.intrinsics();
  result.view.pose = camera.pose;
  return result;
}

/// Returns a header without what describes a rendering or a film back, and for fisheyes without the
/// matrix of a window. A copy, because Imf::Header::erase() of OpenEXR 3.1 leaks the attribute.
Imf::Header camera_header(const Imf::Header& rendered, bool is_pinhole) {
  Imf::Header header;
  for (auto i = rendered.begin(); i != rendered.end(); ++i) {
    const std::string_view name = i.name();
    if (name == "lf:coveredShare" || name == "sensorOverallDimensions" ||
        name == "pinholeFocalLength" || (name == "worldToNDC" && !is_pinhole)) {
      continue;
    }
    header.insert(i.name(), i.attribute());
  }
  return header;
}

void add_text(Imf::Header& header, const char* name, const std::string& text) {
  header.insert(name, Imf::StringAttribute(text));
}

void add_lens_model(Imf::Header& header, const rig::Rig::Camera& camera) {
  const schemas::Intrinsics& lens = camera.model.intrinsics();
  add_text(header, "lf:lensProjection", std::string(schemas::name_of(lens.projection)));
  add_text(header, "lf:lensIntrinsics",
           fmt::format("{} {} {} {}", lens.fx, lens.fy, lens.cx, lens.cy));
  if (lens.projection == schemas::Projection::kPinhole) {
    const schemas::Distortion& d = lens.distortion;
    add_text(header, "lf:lensDistortion",
             fmt::format("{} {} {} {} {}", d.k1, d.k2, d.p1, d.p2, d.k3));
  } else {
    const auto& k = lens.radial_distortion;
    add_text(header, "lf:lensDistortion", fmt::format("{} {} {} {}", k[0], k[1], k[2], k[3]));
    if (lens.half_angle) add_text(header, "lf:lensHalfAngle", fmt::format("{}", *lens.half_angle));
    header.screenWindowCenter() = {0, 0};
    header.screenWindowWidth() = 1;
  }
  if (camera.line_time_us != 0) {
    add_text(header, "lf:lineTimeUs", fmt::format("{}", camera.line_time_us));
  }
}

}  // namespace

FrameExrEncoder::FrameExrEncoder(const store::Take& take, int camera, double fps,
                                 ExrExportOptions options)
    : take_(take),
      camera_(camera),
      options_(std::move(options)),
      metadata_(metadata_of(take, fps, options_)),
      view_(camera_of(take.rig().cameras[camera])),
      scale_(scale_of(take, camera)),
      correction_(correction_of(take, camera)),
      light_(kLevels) {
  for (std::size_t level = 0; level < kLevels; ++level) {
    const double value = static_cast<double>(level) / (kLevels - 1);
    light_[level] =
        static_cast<float>(store::part_from_value(scale_.space, value) * scale_.full_scale);
  }
  const auto& pixels = take.document().cameras[camera].pixels;
  const schemas::PhotometricResponse& response = take.rig().cameras[camera].photometric;
  if (!pixels || pixels->chromaticities || store::needs_per_pixel_correction(response)) return;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t sample = 0; sample < store::kSampleValues; ++sample) {
      light_of_sample_.push_back(static_cast<float>(store::PhotometricCorrection::light_of_sample(
          response, *pixels, c, static_cast<std::uint16_t>(sample))));
    }
  }
}

Imf::Header FrameExrEncoder::header_of(const ChosenFrame& frame) const {
  compose::ExrMetadata metadata = metadata_;
  metadata.frame = frame.number;
  const schemas::TakeDocument& document = take_.document();
  if (frame.source >= 0) metadata.capture_utc = document.epoch_utc + frame.source_ns;
  compose::ExrPart part;
  const bool is_pinhole = view_.view.intrinsics.projection == schemas::Projection::kPinhole;
  Imf::Header header = camera_header(compose::exr_header(part, view_, metadata), is_pinhole);
  add_text(header, "lf:camera", document.cameras[camera_].id);
  add_text(header, "lf:clock", document.clock);
  add_text(header, "lf:timestampEvent", document.timestamp_event);
  if (frame.source >= 0) {
    add_text(header, "lf:frameTimeNs", fmt::format("{}", frame.source_ns));
    header.insert("lf:sourceFrame", Imf::IntAttribute(frame.source));
  }
  if (frame.is_held) header.insert("lf:isHeld", Imf::IntAttribute(1));
  add_lens_model(header, take_.rig().cameras[camera_]);
  return header;
}

std::vector<float> FrameExrEncoder::deep_pixels_of(const store::DeepPicture& picture) const {
  const auto [width, height] = size_of(take_, camera_);
  constexpr std::size_t kChannels = 4;
  std::vector<float> pixels(kChannels * static_cast<std::size_t>(width) *
                            static_cast<std::size_t>(height));
  if (light_of_sample_.empty()) {
    Image<std::uint16_t, 4> levels(width, height);
    correction_.convert(picture, levels.values);
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = light_[levels.values[i]];
    return pixels;
  }
  for (std::size_t i = 0, from = 0; i < pixels.size(); i += kChannels) {
    for (std::size_t c = 0; c < 3; ++c) {
      pixels[i + c] = light_of_sample_[c * store::kSampleValues + picture.samples[from++]];
    }
  }
  return pixels;
}

std::vector<float> FrameExrEncoder::pixels_of(const SourceFrames::Ready& ready) {
  if (ready.deep != nullptr) return deep_pixels_of(*ready.deep);
  const std::string& id = take_.document().cameras[camera_].id;
  const auto [width, height] = size_of(take_, camera_);
  if (take_.document().cameras[camera_].pixels) {  // a black picture
    return std::vector<float>(4 * static_cast<std::size_t>(width) *
                              static_cast<std::size_t>(height));
  }
  const store::JpegLayout layout = store::parse_jpeg_layout(ready.jpeg, id);
  if (layout.width != width || layout.height != height) {
    throw Error::bad_input(
        fmt::format("camera \"{}\" has frames of {}x{} pixels, but {}x{} in its rig", id,
                    layout.width, layout.height, width, height),
        take_.folder().string(), "Use the rig with which the take was recorded");
  }
  const store::McuMask all(static_cast<std::size_t>(layout.mcu_count()), 1);
  Image<std::uint16_t, 4> levels(width, height);
  decoder_.decode_region(ready.jpeg, layout, all, correction_.table(), levels.values, id);
  correction_.correct(levels.values, layout, all);
  std::vector<float> pixels(levels.values.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = light_[levels.values[i]];
  return pixels;
}

std::vector<std::byte> FrameExrEncoder::encode(const SourceFrames::Ready& ready,
                                               SourceFrames& /*source*/) {
  std::vector<float> pixels = pixels_of(ready);
  // Four values a pixel, of which a linear transform leaves the last as it is.
  if (options_.color.from_scene) options_.color.from_scene->apply(pixels);
  compose::ScanlinePart part{header_of(ready.frame), {}};
  for (const auto& [name, channel] : {std::pair{"B", 2}, std::pair{"G", 1}, std::pair{"R", 0}}) {
    part.channels.push_back({name, true, pixels.data() + channel, 4, 0});
  }
  return compose::write_scanline_file(std::span(&part, 1));
}

}  // namespace raystage::exports
