// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::schemas {

/// Schema "raystage/detections/1": the cameras to which a table of detections refers.
struct DetectionsDocument {
  struct Camera {
    std::string id;
    int width = 0, height = 0;  ///< pixels
  };
  std::vector<Camera> cameras;
};

DetectionsDocument read_detections_document(const std::filesystem::path& file);
void write_detections_document(const DetectionsDocument& document,
                               const std::filesystem::path& file);

/// Parses and formats the document in memory; errors use `name` as the file name.
DetectionsDocument parse_detections_document(std::string_view text, std::string_view name);
std::string format_detections_document(const DetectionsDocument& document);

}  // namespace raystage::schemas
