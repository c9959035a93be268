// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "schemas/detections_document.h"

namespace raystage {

/// Where cameras saw points of the world, each at most once: what calibration is made from.
struct Detections {
  struct Detection {
    int camera = 0;         ///< index into `cameras`
    int point = 0;          ///< the same in all cameras: with a moving light, the frame number
    Eigen::Vector2d pixel;  ///< origin at the top-left corner, y down, pixel centres at +0.5
  };
  std::vector<DetectionsDocument::Camera> cameras;
  std::vector<Detection> detections;  ///< by point, then by camera
};

/// Reads a table `camera,frame,u,v` with a line for each detection, in any order, below that
/// header; what stands after v is passed over. Throws Error (bad input), with file and line, for an
/// unknown camera, what is no number, a position a picture's size or more outside the picture, and
/// a camera that sees one point twice.
Detections read_detections(const std::filesystem::path& table, const DetectionsDocument& cameras);
void write_detections(const Detections& detections, const std::filesystem::path& table);

/// The same in memory; `name` stands for the file in errors.
Detections parse_detections(std::string_view text, std::string_view name,
                            const DetectionsDocument& cameras);
std::string format_detections(const Detections& detections);

}  // namespace raystage
