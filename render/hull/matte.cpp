// SPDX-License-Identifier: Apache-2.0
#include "render/hull/matte.h"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "schemas/error.h"

namespace raystage {
namespace {

using Eigen::Vector2d;

/// Bounds of the image in ideal coordinates, from its border.
struct Bounds {
  Vector2d least = Vector2d::Constant(1e30), most = Vector2d::Constant(-1e30);
};

Bounds ideal_bounds(const CameraModel& model) {
  Bounds bounds;
  const auto take_in = [&](double x, double y) {
    const auto ideal = model.ideal_from_pixel({x, y});
    if (!ideal) return;
    bounds.least = bounds.least.cwiseMin(*ideal);
    bounds.most = bounds.most.cwiseMax(*ideal);
  };
  for (int x = 0; x <= model.width(); ++x) {
    take_in(x, 0);
    take_in(x, model.height());
  }
  for (int y = 0; y <= model.height(); ++y) {
    take_in(0, y);
    take_in(model.width(), y);
  }
  return bounds;
}

}  // namespace

std::filesystem::path matte_file(const Take& take, int camera, int frame) {
  return take.folder() / "mattes" / take.document().cameras[static_cast<std::size_t>(camera)].id /
         fmt::format("{:06}.png", frame);
}

Matte::Matte(const CameraModel& model, std::vector<std::uint8_t> codes, double threshold)
    : width_(model.width()),
      height_(model.height()),
      least_(static_cast<std::uint8_t>(std::clamp(std::ceil(threshold * 255), 1.0, 255.0))),
      codes_(std::move(codes)) {
  const Intrinsics& k = model.intrinsics();
  raster_ = {width_, height_, k.fx, k.fy, k.cx, k.cy, {}};
  if (model.has_distortion()) {
    const Bounds bounds = ideal_bounds(model);
    const Vector2d scale(k.fx, k.fy);
    // A lens that sees far to its side would make it endless: four times the image must do, the
    // rest counts as unseen.
    const Vector2d size = ((bounds.most - bounds.least).cwiseProduct(scale))
                              .cwiseMin(4 * Vector2d(width_, height_))
                              .cwiseMax(1.0);
    const Vector2d middle = (bounds.most + bounds.least).cwiseProduct(scale) / 2;
    raster_.width = static_cast<int>(std::ceil(size.x()));
    raster_.height = static_cast<int>(std::ceil(size.y()));
    raster_.cx = raster_.width / 2.0 - middle.x();
    raster_.cy = raster_.height / 2.0 - middle.y();
  }
  raster_.values.reserve(static_cast<std::size_t>(raster_.width) *
                         static_cast<std::size_t>(raster_.height));
  for (int y = 0; y < raster_.height; ++y) {
    for (int x = 0; x < raster_.width; ++x) {
      const auto pixel = model.pixel_from_ideal(
          {(x + 0.5 - raster_.cx) / raster_.fx, (y + 0.5 - raster_.cy) / raster_.fy});
      raster_.values.push_back(pixel ? at_pixel(*pixel) : MatteValue::kUnseen);
    }
  }
}

MatteValue Matte::at_pixel(const Vector2d& pixel) const {
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < width_ && pixel.y() < height_)) {
    return MatteValue::kUnseen;
  }
  const std::size_t at = static_cast<std::size_t>(pixel.y()) * static_cast<std::size_t>(width_) +
                         static_cast<std::size_t>(pixel.x());
  return codes_[at] >= least_ ? MatteValue::kForeground : MatteValue::kBackground;
}

MatteValue Matte::at(const CameraModel& model, const Eigen::Vector3d& direction_in_camera) const {
  const auto pixel = model.project(direction_in_camera);
  return pixel ? at_pixel(*pixel) : MatteValue::kUnseen;
}

Matte read_matte(const std::filesystem::path& file, const CameraModel& model, double threshold) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  const auto refuse = [&](const std::string& what) {
    png_image_free(&image);
    return Error::bad_input(what, file.string(),
                            fmt::format("Write a PNG of {}x{} pixels, 8 bits, grey, see "
                                        "docs/formats/mattes.md",
                                        model.width(), model.height()));
  };
  if (png_image_begin_read_from_file(&image, file.c_str()) == 0) {
    throw refuse(std::string("the matte cannot be read: ") + image.message);
  }
  if (static_cast<int>(image.width) != model.width() ||
      static_cast<int>(image.height) != model.height()) {
    throw refuse(fmt::format("the matte has {}x{} pixels, its camera {}x{}", image.width,
                             image.height, model.width(), model.height()));
  }
  // Codes as they are: grey, without alpha and without a change of curve.
  image.format = PNG_FORMAT_GRAY;
  std::vector<std::uint8_t> codes(PNG_IMAGE_SIZE(image));
  const png_color black{0, 0, 0};
  if (png_image_finish_read(&image, &black, codes.data(), 0, nullptr) == 0) {
    throw refuse(std::string("the matte cannot be read: ") + image.message);
  }
  return {model, std::move(codes), threshold};
}

}  // namespace raystage
