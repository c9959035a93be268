// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "rig/camera_model.h"

namespace raystage {

/// What a camera's matte says of an image point.
enum class MatteValue : std::uint8_t { kBackground = 0, kForeground = 1, kUnseen = 2 };

/// A camera's silhouette.
class Matte {
 public:
  /// `codes`: 8 bits a pixel of the camera's image; foreground from `threshold` (0 to 1) of 255 on.
  Matte(const CameraModel& model, std::vector<std::uint8_t> codes, double threshold);

  /// Without the lens: a straight line in space is a straight line here. Pixels of the raster stand
  /// as dense as those of the image's middle.
  struct Raster {
    int width = 0, height = 0;
    double fx = 1, fy = 1, cx = 0, cy = 0;  ///< position = (fx x + cx, fy y + cy), ideal x, y
    std::vector<MatteValue> values;

    /// How far, in pixels along either axis or both, all pixels have the same value as this one:
    /// 254 at most. A walk may leave out what it knows already.
    std::vector<std::uint8_t> uniform_radius;
    void compute_uniform_radius();
  };
  const Raster& raster() const { return raster_; }

  /// The reference: through the lens, at the pixel that holds the point.
  MatteValue at(const CameraModel& model, const Eigen::Vector3d& direction_in_camera) const;

  std::size_t bytes() const {
    return codes_.size() + raster_.values.size() + raster_.uniform_radius.size();
  }

 private:
  MatteValue at_pixel(const Eigen::Vector2d& pixel) const;

  int width_ = 0, height_ = 0;
  std::uint8_t least_ = 128;  ///< code of foreground
  std::vector<std::uint8_t> codes_;
  Raster raster_;
};

/// Throws Error (bad input) for a file that is no PNG or not of the camera's size.
Matte read_matte(const std::filesystem::path& file, const CameraModel& model, double threshold);

}  // namespace raystage
