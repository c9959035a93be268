// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/detections_document.h"

namespace raystage::calibrate {

/// Detections of points of the world, each at most once per camera: the input of a calibration.
struct Detections {
  struct Detection {
    int camera = 0;         ///< index into `cameras`
    int point = 0;          ///< common to all cameras: with a moving light, the frame number
    Eigen::Vector2d pixel;  ///< origin at the top-left corner, y down, pixel centres at +0.5
  };
  std::vector<schemas::DetectionsDocument::Camera> cameras;
  std::vector<Detection> detections;  ///< by point, then by camera
};

/// Reads a table with the header `camera,frame,u,v` and a line per detection, in any order; further
/// columns are ignored. Throws Error (bad input), with file and line, for an unknown camera or a
/// value that is not a number. It also throws for a position a picture's size or more outside the
/// picture, and for two detections of a point in one camera.
Detections read_detections(const std::filesystem::path& table,
                           const schemas::DetectionsDocument& cameras);
void write_detections(const Detections& detections, const std::filesystem::path& table);

/// Converts the table from and to text; `name` replaces the file in errors.
Detections parse_detections(std::string_view text, std::string_view name,
                            const schemas::DetectionsDocument& cameras);
std::string format_detections(const Detections& detections);

}  // namespace raystage::calibrate
