// SPDX-License-Identifier: Apache-2.0
#include "schemas/detections_document.h"

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using DetectionCamera = DetectionsDocument::Camera;

constexpr Fields kDetections(
    required("cameras", &DetectionsDocument::cameras,
             list_with_ids(Fields(required("id", &DetectionCamera::id),
                                  required("width", &DetectionCamera::width),
                                  required("height", &DetectionCamera::height)))));

}  // namespace

DetectionsDocument parse_detections_document(std::string_view text, std::string_view name) {
  return parse_document_as<DetectionsDocument>("detections", kDetections, text, name);
}

std::string format_detections_document(const DetectionsDocument& document) {
  return format_document("detections", kDetections, document);
}

DetectionsDocument read_detections_document(const std::filesystem::path& file) {
  return parse_detections_document(read_file(file), file.string());
}

void write_detections_document(const DetectionsDocument& document,
                               const std::filesystem::path& file) {
  write_document(format_detections_document(document), parse_detections_document, file);
}

}  // namespace raystage::schemas
