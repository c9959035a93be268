// SPDX-License-Identifier: Apache-2.0
#include "schemas/planes_document.h"

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

constexpr Fields kPlanes(
    required("planes", &PlanesDocument::planes,
             list_with_ids(Fields(required("id", &PlanesDocument::Plane::id),
                                  required("corners", &PlanesDocument::Plane::corners)))));

}  // namespace

PlanesDocument parse_planes(std::string_view text, std::string_view name) {
  return parse_document_as<PlanesDocument>("planes", kPlanes, text, name);
}

std::string format_planes(const PlanesDocument& planes) {
  return format_document("planes", kPlanes, planes);
}

PlanesDocument read_planes(const std::filesystem::path& file) {
  return parse_planes(read_file(file), file.string());
}

}  // namespace raystage::schemas
