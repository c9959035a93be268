// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/contained_path.h"
#include "base/image.h"
#include "rig/camera_model.h"

namespace raystage::store {
class MatteReader;
}

namespace raystage::render {

enum class MatteValue : std::uint8_t { kBackground = 0, kForeground = 1, kUnseen = 2 };

class Matte {
 public:
  /// Stores `codes`, 8 bits per pixel of the camera's image; foreground from 255 * `threshold` (0
  /// to 1).
  Matte(const rig::CameraModel& model, std::vector<std::uint8_t> codes, double threshold);

  /// The matte without lens distortion: straight lines in space are straight here. Its pixel
  /// density is that of the image's middle.
  struct Raster : Image<MatteValue> {
    double fx = 1, fy = 1, cx = 0, cy = 0;  ///< position = (fx x + cx, fy y + cy) of ideal x, y

    /// Per pixel: the radius, in pixels along both axes, within which all values are equal; at most
    /// 254. Walks skip that far.
    Image<std::uint8_t> uniform_radius;
    void compute_uniform_radius();
  };
  const Raster& raster() const { return raster_; }

  /// Returns the value of the pixel that contains the point, through the lens: the reference.
  MatteValue at(const rig::CameraModel& model, const Eigen::Vector3d& direction_in_camera) const;

  std::size_t bytes() const {
    return codes_.size() + raster_.values.size() + raster_.uniform_radius.values.size();
  }

 private:
  MatteValue at_pixel(const Eigen::Vector2d& pixel) const;

  int width_ = 0, height_ = 0;
  std::uint8_t least_ = 128;  ///< smallest code of foreground
  std::vector<std::uint8_t> codes_;
  Raster raster_;
};

/// Reads a PNG. Throws as store::MatteReader::read().
Matte read_matte(const store::MatteReader& reader, const ContainedPath& file,
                 const rig::CameraModel& model, double threshold);

}  // namespace raystage::render
