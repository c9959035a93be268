// SPDX-License-Identifier: Apache-2.0
#include "schemas/rig_document.h"

#include <algorithm>

#include "base/contained_path.h"
#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

constexpr auto kPhotometric = custom(
    [](const JsonNode& object, RigDocument::Camera& camera) {
      if (!object.has("photometric")) return;
      camera.photometric = photometric_from(object.at("photometric"), camera.geometry);
    },
    [](const RigDocument::Camera& camera, nlohmann::ordered_json& object) {
      if (camera.photometric == PhotometricResponse{}) return;
      object["photometric"] = json_from(camera.photometric);
    });

constexpr Fields kRig(defaulted("name", &RigDocument::name),
                      defaulted("topology", &RigDocument::topology),
                      required("cameras", &RigDocument::cameras,
                               list_with_ids(Fields(kGeometryFields, kPhotometric))));

}  // namespace

const RigDocument::Camera* RigDocument::find(std::string_view id) const {
  const auto found =
      std::ranges::find_if(cameras, [&](const Camera& camera) { return camera.geometry.id == id; });
  return found == cameras.end() ? nullptr : &*found;
}

RigDocument parse_rig(std::string_view text, std::string_view name) {
  return parse_document_as<RigDocument>("rig", kRig, text, name);
}

std::string format_rig(const RigDocument& rig) {
  const bool is_plain = std::ranges::all_of(rig.cameras, [](const RigDocument::Camera& camera) {
    return is_plain_camera(camera.geometry);
  });
  return format_document("rig", kRig, rig, is_plain ? 1 : 2);
}

RigDocument read_rig(const std::filesystem::path& file) {
  return parse_rig(read_file(file), file.string());
}

RigDocument read_rig(const ContainedPath& file) {
  return parse_rig(read_file(file), file.path().string());
}

void write_rig(const RigDocument& rig, const std::filesystem::path& file) {
  write_document(format_rig(rig), parse_rig, file);
}

}  // namespace raystage::schemas
