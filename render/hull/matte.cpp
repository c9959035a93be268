// SPDX-License-Identifier: Apache-2.0
// Thresholds a camera's matte and resamples it without lens distortion, so that rays are straight
// lines in it. Also computes the radius of uniform values around each pixel, for fast walks. Cost:
// O(pixels).
#include "render/hull/matte.h"

#include <algorithm>
#include <cmath>

#include "store/processing/mattes/matte_file.h"

namespace raystage::render {
namespace {

using Eigen::Vector2d;

/// Bounds of the image's border in ideal coordinates.
struct Bounds {
  Vector2d least = Vector2d::Constant(1e30), most = Vector2d::Constant(-1e30);
};

Bounds ideal_bounds(const rig::CameraModel& model) {
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

constexpr std::uint8_t kMaxSimilarity = 254;  // 255 must not overflow a byte

/// Returns the minimum of each value and its left and right one; kMaxSimilarity if `row` is null.
void least_of_three(const std::uint8_t* row, std::vector<std::uint8_t>& least) {
  if (row == nullptr) {
    std::ranges::fill(least, kMaxSimilarity);
    return;
  }
  const std::size_t last = least.size() - 1;
  for (std::size_t x = 1; x < last; ++x) {
    least[x] = std::min(std::min(row[x - 1], row[x]), row[x + 1]);
  }
  least[0] = std::min(row[0], row[std::min<std::size_t>(1, last)]);
  least[last] = std::min(row[last], row[last - std::min<std::size_t>(1, last)]);
}

}  // namespace

Matte::Matte(const rig::CameraModel& model, std::vector<std::uint8_t> codes, double threshold)
    : width_(model.width()),
      height_(model.height()),
      least_(static_cast<std::uint8_t>(std::clamp(std::ceil(threshold * 255), 1.0, 255.0))),
      codes_(std::move(codes)) {
  const schemas::Intrinsics& k = model.intrinsics();
  raster_.width = width_;
  raster_.height = height_;
  raster_.fx = k.fx;
  raster_.fy = k.fy;
  raster_.cx = k.cx;
  raster_.cy = k.cy;
  if (model.has_distortion()) {
    const Bounds bounds = ideal_bounds(model);
    const Vector2d scale(k.fx, k.fy);
    // Limit the raster of wide lenses to four times the image; the rest counts as unseen.
    const Vector2d size = ((bounds.most - bounds.least).cwiseProduct(scale))
                              .cwiseMin(4 * Vector2d(width_, height_))
                              .cwiseMax(1.0);
    const Vector2d middle = (bounds.most + bounds.least).cwiseProduct(scale) / 2;
    raster_.width = static_cast<int>(std::ceil(size.x()));
    raster_.height = static_cast<int>(std::ceil(size.y()));
    raster_.cx = raster_.width / 2.0 - middle.x();
    raster_.cy = raster_.height / 2.0 - middle.y();
  }
  raster_.values.reserve(static_cast<std::size_t>(raster_.width) * raster_.height);
  for (int y = 0; y < raster_.height; ++y) {
    for (int x = 0; x < raster_.width; ++x) {
      const auto pixel = model.pixel_from_ideal(
          {(x + 0.5 - raster_.cx) / raster_.fx, (y + 0.5 - raster_.cy) / raster_.fy});
      raster_.values.push_back(pixel ? at_pixel(*pixel) : MatteValue::kUnseen);
    }
  }
  raster_.compute_uniform_radius();
}

/// Computes the radius by chessboard distances (Rosenfeld and Pfaltz, "Distance functions on
/// digital pictures", 1968) to the nearest pixel next to a different value.
void Matte::Raster::compute_uniform_radius() {
  const auto columns = static_cast<std::size_t>(width);
  uniform_radius = Image<std::uint8_t>(width, height);
  for (int y = 0; y < height; ++y) {
    const std::span<const MatteValue> above = row(std::max(y - 1, 0)), here = row(y),
                                      below = row(std::min(y + 1, height - 1));
    const std::span<std::uint8_t> out = uniform_radius.row(y);
    const auto all_are = [&](std::size_t x, MatteValue value) {
      return above[x] == value && here[x] == value && below[x] == value;
    };
    for (std::size_t x = 0; x < columns; ++x) {
      const bool same = all_are(x > 0 ? x - 1 : x, here[x]) && all_are(x, here[x]) &&
                        all_are(x + 1 < columns ? x + 1 : x, here[x]);
      out[x] = same ? kMaxSimilarity : 0;
    }
  }
  // Two passes: downwards to the right, then upwards to the left.
  std::vector<std::uint8_t> least(columns);
  for (int y = 0; y < height; ++y) {
    std::uint8_t* radius = uniform_radius.row(y).data();
    least_of_three(y > 0 ? radius - columns : nullptr, least);
    for (std::size_t x = 0; x < columns; ++x) {
      const int beside = x > 0 ? std::min(least[x], radius[x - 1]) : least[x];
      radius[x] = static_cast<std::uint8_t>(std::min<int>(radius[x], beside + 1));
    }
  }
  for (int y = height - 1; y >= 0; --y) {
    std::uint8_t* radius = uniform_radius.row(y).data();
    least_of_three(y + 1 < height ? radius + columns : nullptr, least);
    for (std::size_t x = columns; x-- > 0;) {
      const int beside = x + 1 < columns ? std::min(least[x], radius[x + 1]) : least[x];
      radius[x] = static_cast<std::uint8_t>(std::min<int>(radius[x], beside + 1));
    }
  }
}

MatteValue Matte::at_pixel(const Vector2d& pixel) const {
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < width_ && pixel.y() < height_)) {
    return MatteValue::kUnseen;
  }
  const std::size_t at = static_cast<std::size_t>(pixel.y()) * width_ + pixel.x();
  return codes_[at] >= least_ ? MatteValue::kForeground : MatteValue::kBackground;
}

MatteValue Matte::at(const rig::CameraModel& model,
                     const Eigen::Vector3d& direction_in_camera) const {
  const auto pixel = model.project(direction_in_camera);
  return pixel ? at_pixel(*pixel) : MatteValue::kUnseen;
}

Matte read_matte(const store::MatteReader& reader, const ContainedPath& file,
                 const rig::CameraModel& model, double threshold) {
  return {model, reader.read(file, model.width(), model.height()), threshold};
}

}  // namespace raystage::render
