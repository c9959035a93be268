// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/geometry.h"

namespace raystage::schemas {

/// Schema "raystage/array_specification/1": what an array must be able to show (thesis 6.1.1), and
/// what it can be built of. Prices are in any one currency.
struct ArraySpecification {
  /// The virtual cameras. Angles are horizontal, full angles, in degrees.
  struct Views {
    int width_px = 0, height_px = 0;
    double least_fov_deg = 0, largest_fov_deg = 0;
    double max_yaw_deg = 0, max_pitch_deg = 0;  ///< to both sides
    double interaxial_mm = 0;                   ///< of stereo cameras; 0: one eye
  };
  /// A place of the virtual camera, metres: to the right, upwards, and in front of the array.
  struct Position {
    double x_m = 0, y_m = 0, depth_m = 0;
    std::optional<double> yaw_deg, pitch_deg;  ///< nullopt: any, as Views states
  };
  /// A sphere in the middle in front of the array.
  struct Subject {
    double depth_m = 0, radius_m = 0;
  };
  /// A camera with its lenses.
  struct Camera {
    std::string id;  ///< unique
    int width_px = 0, height_px = 0;
    double sensor_width_mm = 0;
    std::vector<double> focal_lengths_mm;
    double body_mm = 0;             ///< least distance of two cameras
    std::optional<double> max_fps;  ///< nullopt: any
    double bits_per_pixel = 2;      ///< of its JPEG frames
    double price = 0;
  };
  struct Node {
    int cameras = 0;  ///< that it has ports for
    double megabytes_per_s = 0, price = 0;
  };
  struct Disk {
    double gigabytes = 0, megabytes_per_s = 0, price = 0;
  };

  std::string name;
  Views views;
  std::vector<Position> positions;
  int sides = 1;  ///< 6: the array is on each side of a cube around the middle of the positions
  DepthRange depth_range;
  double largest_error_px = 1;     ///< of the views, on one focal plane
  std::optional<Subject> subject;  ///< nullopt: all rays of a view are needed
  double fps = 0, minutes = 0;
  std::optional<double> megapixels_per_s;
  std::vector<Camera> cameras;
  Node node;
  Disk disk;
};

/// Reads the document. Throws Error (bad input) with the file, the JSON pointer, the value found
/// and what is allowed.
ArraySpecification read_array_specification(const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
ArraySpecification parse_array_specification(std::string_view text, std::string_view name);
std::string format_array_specification(const ArraySpecification& specification);

}  // namespace raystage::schemas
