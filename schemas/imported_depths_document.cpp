// SPDX-License-Identifier: Apache-2.0
#include "schemas/imported_depths_document.h"

#include <algorithm>

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using DepthsDocument = ImportedDepthsDocument;
using DepthImport = DepthsDocument::Import;
using ImportedMap = DepthsDocument::Map;

constexpr Fields kImportedFrom(required("utc", &DepthImport::utc, kUtc),
                               required("by", &DepthImport::by),
                               required("folder", &DepthImport::folder, kPath),
                               required("encoding", &DepthImport::encoding));

constexpr auto kDepthQuantities =
    enum_names<DepthsDocument::Quantity>("inverse_depth", "inverse_distance");

constexpr Fields kImportedMap(required("frame", &ImportedMap::frame),
                              required("frame_xxh3", &ImportedMap::frame_xxh3),
                              required("file", &ImportedMap::file, kRelativePath),
                              required("quantity", &ImportedMap::quantity, kDepthQuantities),
                              required("width", &ImportedMap::width),
                              required("height", &ImportedMap::height),
                              required("unknown_share", &ImportedMap::unknown_share),
                              required("import", &ImportedMap::import),
                              required("source", &ImportedMap::source, kPath),
                              required("source_sha256", &ImportedMap::source_sha256));

/// Frames increase, so that a frame has one map.
constexpr auto kIncreasingFrames = [](const JsonNode& item, const std::vector<ImportedMap>& maps) {
  if (maps.size() < 2 || maps[maps.size() - 2].frame < maps.back().frame) return;
  throw item.at("frame").input_error("the frame is not greater than that of the map before",
                                     "Restore the file, or import the depth maps again");
};

constexpr Fields kImportedDepths(
    required("imports", &DepthsDocument::imports, list_of(kImportedFrom)),
    required("cameras", &DepthsDocument::cameras,
             list_with_ids(Fields(required("id", &DepthsDocument::Camera::id),
                                  required("maps", &DepthsDocument::Camera::maps,
                                           list_of(kImportedMap, kIncreasingFrames))))),
    check([](const JsonNode& node, const DepthsDocument& document) {
      for (std::size_t c = 0; c < document.cameras.size(); ++c) {
        const std::vector<ImportedMap>& maps = document.cameras[c].maps;
        for (std::size_t i = 0; i < maps.size(); ++i) {
          if (static_cast<std::size_t>(maps[i].import) < document.imports.size()) continue;
          throw node.at("cameras").at(c).at("maps").at(i).at("import").input_error(
              "there is no such import", "Restore the file, or import the depth maps again");
        }
      }
    }));

}  // namespace

const ImportedMap* ImportedDepthsDocument::find(std::string_view camera, std::int32_t frame) const {
  const auto of_camera = std::ranges::find(cameras, camera, &Camera::id);
  if (of_camera == cameras.end()) return nullptr;
  const auto found = std::ranges::lower_bound(of_camera->maps, frame, {}, &Map::frame);
  return found == of_camera->maps.end() || found->frame != frame ? nullptr : &*found;
}

ImportedDepthsDocument parse_imported_depths(std::string_view text, std::string_view name) {
  return parse_document_as<ImportedDepthsDocument>("imported_depths", kImportedDepths, text, name);
}

std::string format_imported_depths(const ImportedDepthsDocument& document) {
  return format_document("imported_depths", kImportedDepths, document);
}

void write_imported_depths(const ImportedDepthsDocument& document,
                           const std::filesystem::path& file) {
  write_document(format_imported_depths(document), parse_imported_depths, file);
}

}  // namespace raystage::schemas
