// SPDX-License-Identifier: Apache-2.0
// Reads and writes models.json of Google's Immersive Light Field Video (Broxton et al., "Immersive
// Light Field Video with a Layered Mesh Representation", 2020; readme of the repository
// augmentedperception/deepview_video_dataset). A fisheye has the formula of OpenCV's cv::fisheye:
// theta_d = theta (1 + k1 theta^2 + k2 theta^4 + ...), pixel = focal_length * theta_d (x, y) +
// principal_point, with y down. The readme does not state pixel centres: taken as at +0.5. Cost:
// linear in the cameras.
#include "ingest/rig_formats/google_models.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <set>

#include "ingest/rig_formats/rig_conversion.h"
#include "schemas/json_text.h"
#include "schemas/validator.h"

namespace raystage::ingest {
namespace {

using nlohmann::json;
using schemas::Projection;

// The properties that are read; all others are ignored.
constexpr const char* kGoogleSchema = R"({
  "$defs": {
    "camera": {
      "type": "object",
      "required": ["name", "width", "height", "focal_length", "principal_point", "orientation",
                   "position", "projection_type"],
      "properties": {
        "name": {"type": "string", "minLength": 1, "maxLength": 100,
                 "pattern": "^[A-Za-z0-9_-][A-Za-z0-9._-]*$",
                 "patternDescription": "letters, digits, '.', '_' and '-', not starting with '.'"},
        "width": {"type": "integer", "minimum": 1, "maximum": 65535},
        "height": {"type": "integer", "minimum": 1, "maximum": 65535},
        "focal_length": {"type": "number", "exclusiveMinimum": 0, "maximum": 10000000},
        "pixel_aspect_ratio": {"const": 1},
        "principal_point": {"type": "array", "minItems": 2, "maxItems": 2,
                            "items": {"type": "number", "minimum": -10000000,
                                      "maximum": 10000000}},
        "radial_distortion": {"type": "array", "maxItems": 4,
                              "items": {"type": "number", "minimum": -1000000,
                                        "maximum": 1000000}},
        "orientation": {"type": "array", "minItems": 3, "maxItems": 3,
                        "items": {"type": "number", "minimum": -1000, "maximum": 1000}},
        "position": {"type": "array", "minItems": 3, "maxItems": 3,
                     "items": {"type": "number", "minimum": -1000000000, "maximum": 1000000000}},
        "projection_type": {"const": "fisheye"}
      }
    }
  },
  "type": "array", "minItems": 1, "maxItems": 10000, "items": {"$ref": "#/$defs/camera"}
})";

class GoogleModelsFormat : public RigFormat {
 public:
  std::string_view name() const override { return "google"; }
  std::string_view description() const override {
    return "models.json of Google's Immersive Light Field Video";
  }
  std::vector<std::string> files() const override { return {"models.json"}; }
  std::vector<std::string> picture_folders() const override { return {""}; }
  bool matches(const JsonOutline& outline) const override {
    const bool has_pose = outline.has("orientation") && outline.has("position");
    return outline.is_list && (outline.has("projection_type") || has_pose);
  }
  ForeignRig parse(std::span<const NamedText> files,
                   const PictureSizeReader& size_of_picture) const override;
  ExportedRig format(const schemas::RigDocument& rig) const override;
};

Eigen::Vector3d google_vector(const json& values) {
  return {values[0].get<double>(), values[1].get<double>(), values[2].get<double>()};
}

schemas::CameraGeometry google_camera(const json& camera) {
  schemas::CameraGeometry result;
  result.id = camera["name"].get<std::string>();
  result.width = camera["width"].get<int>();
  result.height = camera["height"].get<int>();
  schemas::Intrinsics& lens = result.intrinsics;
  lens.projection = Projection::kFisheye;
  lens.fx = lens.fy = camera["focal_length"].get<double>();
  lens.cx = camera["principal_point"][0].get<double>();
  lens.cy = camera["principal_point"][1].get<double>();
  if (const auto distortion = camera.find("radial_distortion"); distortion != camera.end()) {
    for (std::size_t i = 0; i < distortion->size(); ++i) {
      lens.radial_distortion.at(i) = (*distortion)[i].get<double>();
    }
  }
  const Eigen::Vector3d rotation = google_vector(camera["orientation"]);
  const double angle = rotation.norm();
  const Eigen::Vector3d axis =
      angle > 0 ? Eigen::Vector3d(rotation / angle) : Eigen::Vector3d(Eigen::Vector3d::UnitX());
  const rig::Pose pose = pose_from_opencv(Eigen::AngleAxisd(angle, axis).toRotationMatrix(),
                                          google_vector(camera["position"]));
  result.world_from_camera = rig::matrix_from_pose(pose);
  return result;
}

ForeignRig GoogleModelsFormat::parse(std::span<const NamedText> files,
                                     const PictureSizeReader& /*size_of_picture*/) const {
  const std::string& name = files[0].name;
  const json document = schemas::parse_json(files[0].text, name);
  schemas::SchemaValidator(json::parse(kGoogleSchema)).validate(document, name);
  ForeignRig rig;
  std::set<std::string> seen;
  for (std::size_t i = 0; i < document.size(); ++i) {
    const std::string pointer = schemas::append_json_pointer("", i);
    rig.cameras.push_back({.geometry = google_camera(document[i]), .place = name + "#" + pointer});
    const std::string& id = rig.cameras.back().geometry.id;
    if (!seen.insert(id).second) {
      throw schemas::json_value_error(name, schemas::append_json_pointer(pointer, "name"),
                                      fmt::format("the name \"{}\" is used twice", id),
                                      "Give each camera a unique name");
    }
  }
  return rig;
}

void check_lens_for_google(const schemas::CameraGeometry& camera) {
  const schemas::Intrinsics& lens = camera.intrinsics;
  if (lens.projection != Projection::kFisheye && lens.projection != Projection::kFtheta) {
    throw lens_error(camera, "models.json has only OpenCV's fisheye", "Choose another format");
  }
  if (lens.fx != lens.fy) {
    throw lens_error(camera,
                     fmt::format("models.json has one focal length, the lens has {} and {} px",
                                 lens.fx, lens.fy),
                     "Calibrate the lens with square pixels, or choose another format");
  }
}

ExportedRig GoogleModelsFormat::format(const schemas::RigDocument& rig) const {
  auto cameras = nlohmann::ordered_json::array();
  for (const schemas::RigDocument::Camera& entry : rig.cameras) {
    const schemas::CameraGeometry& camera = entry.geometry;
    const schemas::Intrinsics& lens = camera.intrinsics;
    check_lens_for_google(camera);
    const rig::Pose pose = rig::pose_from_matrix(camera.world_from_camera);
    const Eigen::AngleAxisd turn(Eigen::Quaterniond(opencv_camera_from_world_rotation(pose)));
    const Eigen::Vector3d rotation = turn.angle() * turn.axis();
    const auto& k = lens.radial_distortion;
    nlohmann::ordered_json distortion{k[0], k[1], k[2]};
    if (k[3] != 0) distortion.push_back(k[3]);
    cameras.push_back({{"name", camera.id},
                       {"width", camera.width},
                       {"height", camera.height},
                       {"focal_length", lens.fx},
                       {"principal_point", {lens.cx, lens.cy}},
                       {"radial_distortion", std::move(distortion)},
                       {"orientation", {rotation.x(), rotation.y(), rotation.z()}},
                       {"position", {pose.position.x(), pose.position.y(), pose.position.z()}},
                       {"projection_type", "fisheye"}});
  }
  return {{{"models.json", schemas::format_json(cameras)}}, losses_of(rig, {})};
}

}  // namespace

const RigFormat& google_models_format() {
  static const GoogleModelsFormat kFormat;
  return kFormat;
}

}  // namespace raystage::ingest
