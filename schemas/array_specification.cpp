// SPDX-License-Identifier: Apache-2.0
#include "schemas/array_specification.h"

#include <fmt/format.h>

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using Views = ArraySpecification::Views;
using Position = ArraySpecification::Position;
using Subject = ArraySpecification::Subject;
using CatalogueCamera = ArraySpecification::Camera;
using Node = ArraySpecification::Node;
using Disk = ArraySpecification::Disk;

constexpr Fields kViews(required("width_px", &Views::width_px),
                        required("height_px", &Views::height_px),
                        required("least_fov_deg", &Views::least_fov_deg),
                        required("largest_fov_deg", &Views::largest_fov_deg),
                        defaulted("max_yaw_deg", &Views::max_yaw_deg),
                        defaulted("max_pitch_deg", &Views::max_pitch_deg),
                        defaulted("interaxial_mm", &Views::interaxial_mm),
                        check([](const JsonNode& object, const Views& views) {
                          if (views.least_fov_deg <= views.largest_fov_deg) return;
                          throw object.at("largest_fov_deg")
                              .input_error(fmt::format("found {}, allowed: at least least_fov_deg",
                                                       views.largest_fov_deg),
                                           "Exchange the two");
                        }));
constexpr Fields kPosition(required("x_m", &Position::x_m), required("y_m", &Position::y_m),
                           required("depth_m", &Position::depth_m),
                           optional("yaw_deg", &Position::yaw_deg),
                           optional("pitch_deg", &Position::pitch_deg));
constexpr Fields kSubject(required("depth_m", &Subject::depth_m),
                          required("radius_m", &Subject::radius_m));
constexpr Fields kCatalogueCamera(required("id", &CatalogueCamera::id),
                                  required("width_px", &CatalogueCamera::width_px),
                                  required("height_px", &CatalogueCamera::height_px),
                                  required("sensor_width_mm", &CatalogueCamera::sensor_width_mm),
                                  required("focal_lengths_mm", &CatalogueCamera::focal_lengths_mm),
                                  defaulted("body_mm", &CatalogueCamera::body_mm),
                                  optional("max_fps", &CatalogueCamera::max_fps),
                                  defaulted("bits_per_pixel", &CatalogueCamera::bits_per_pixel),
                                  required("price", &CatalogueCamera::price));
constexpr Fields kNode(required("cameras", &Node::cameras),
                       required("megabytes_per_s", &Node::megabytes_per_s),
                       required("price", &Node::price));
constexpr Fields kDisk(required("gigabytes", &Disk::gigabytes),
                       required("megabytes_per_s", &Disk::megabytes_per_s),
                       required("price", &Disk::price));

constexpr Fields kSpecification(
    defaulted("name", &ArraySpecification::name),
    required("views", &ArraySpecification::views, kViews),
    required("positions", &ArraySpecification::positions, list_of(kPosition)),
    defaulted("sides", &ArraySpecification::sides),
    required("depth_range_m", &ArraySpecification::depth_range, kDepthRange),
    defaulted("largest_error_px", &ArraySpecification::largest_error_px),
    optional("subject", &ArraySpecification::subject, kSubject),
    required("fps", &ArraySpecification::fps), required("minutes", &ArraySpecification::minutes),
    optional("megapixels_per_s", &ArraySpecification::megapixels_per_s),
    required("cameras", &ArraySpecification::cameras, list_with_ids(kCatalogueCamera)),
    required("node", &ArraySpecification::node, kNode),
    required("disk", &ArraySpecification::disk, kDisk));

}  // namespace

ArraySpecification parse_array_specification(std::string_view text, std::string_view name) {
  return parse_document_as<ArraySpecification>("array_specification", kSpecification, text, name);
}

std::string format_array_specification(const ArraySpecification& specification) {
  return format_document("array_specification", kSpecification, specification);
}

ArraySpecification read_array_specification(const std::filesystem::path& file) {
  return parse_array_specification(read_file(file), file.string());
}

}  // namespace raystage::schemas
