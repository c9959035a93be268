// SPDX-License-Identifier: Apache-2.0
// Reads and writes rig.json of facebook360_dep (source/util/Camera.h): the angle of a ray to the
// axis becomes r by the type, r' = r + d0 r^3 + d1 r^5 + d2 r^7, and pixel = focal * r' (x, y) +
// principal, with y up and focal[1] negative. Pixel centres are at +0.5 (source/util/CvUtil.h,
// getPixelBilinear()). RECTILINEAR is the pinhole with k1, k2 and k3. Cost: linear in the cameras.
#include "ingest/rig_formats/facebook_rig.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <array>
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
constexpr const char* kFacebookSchema = R"({
  "$defs": {
    "unit": {"type": "array", "minItems": 3, "maxItems": 3,
             "items": {"type": "number", "minimum": -1.01, "maximum": 1.01}},
    "position": {"type": "array", "minItems": 3, "maxItems": 3,
                 "items": {"type": "number", "minimum": -1000000000, "maximum": 1000000000}},
    "camera": {
      "type": "object",
      "required": ["version", "id", "type", "origin", "right", "up", "forward", "resolution",
                   "focal"],
      "properties": {
        "version": {"type": "number", "minimum": 1, "exclusiveMaximum": 2},
        "id": {"type": "string", "minLength": 1, "maxLength": 100,
               "pattern": "^[A-Za-z0-9_-][A-Za-z0-9._-]*$",
               "patternDescription": "letters, digits, '.', '_' and '-', not starting with '.'"},
        "type": {"enum": ["FTHETA", "RECTILINEAR", "EQUISOLID", "ORTHOGRAPHIC"]},
        "origin": {"$ref": "#/$defs/position"},
        "right": {"$ref": "#/$defs/unit"}, "up": {"$ref": "#/$defs/unit"},
        "forward": {"$ref": "#/$defs/unit"},
        "resolution": {"type": "array", "minItems": 2, "maxItems": 2,
                       "items": {"type": "integer", "minimum": 1, "maximum": 65535}},
        "focal": {"type": "array", "minItems": 2, "maxItems": 2,
                  "items": {"type": "number", "minimum": -10000000, "maximum": 10000000}},
        "principal": {"type": "array", "minItems": 2, "maxItems": 2,
                      "items": {"type": "number", "minimum": -10000000, "maximum": 10000000}},
        "distortion": {"type": "array", "maxItems": 3,
                       "items": {"type": "number", "minimum": -1000000, "maximum": 1000000}},
        "fov": {"type": "number", "exclusiveMinimum": 0, "maximum": 3.141592653589793}
      }
    }
  },
  "type": "object",
  "required": ["cameras"],
  "properties": {"cameras": {"type": "array", "minItems": 1, "maxItems": 10000,
                             "items": {"$ref": "#/$defs/camera"}}}
})";

/// Some files are a single camera: the prototype of a rig.
bool is_single_camera(const json& document) {
  return document.is_object() && !document.contains("cameras") && document.contains("origin");
}

void check_facebook_schema(const json& document, std::string_view name) {
  json schema = json::parse(kFacebookSchema);
  if (is_single_camera(document)) {
    json camera = schema["$defs"]["camera"];
    camera["$defs"] = schema["$defs"];
    schema = std::move(camera);
  }
  schemas::SchemaValidator(std::move(schema)).validate(document, name);
}

struct FacebookType {
  std::string_view name;
  Projection projection;
};
constexpr std::array<FacebookType, 4> kFacebookTypes{{{"FTHETA", Projection::kFtheta},
                                                      {"RECTILINEAR", Projection::kPinhole},
                                                      {"EQUISOLID", Projection::kEquisolid},
                                                      {"ORTHOGRAPHIC", Projection::kOrthographic}}};

Projection projection_of_type(std::string_view name) {
  for (const FacebookType& type : kFacebookTypes) {
    if (type.name == name) return type.projection;
  }
  return Projection::kPinhole;  // the schema has refused other names
}

/// OpenCV's fisheye has the same formula as FTHETA.
std::string_view type_of_projection(Projection projection) {
  if (projection == Projection::kFisheye) return "FTHETA";
  for (const FacebookType& type : kFacebookTypes) {
    if (type.projection == projection) return type.name;
  }
  return "";
}

Eigen::Vector3d vector_from(const json& values) {
  return {values[0].get<double>(), values[1].get<double>(), values[2].get<double>()};
}

schemas::Intrinsics facebook_intrinsics(const json& camera) {
  schemas::Intrinsics result;
  result.projection = projection_of_type(camera["type"].get<std::string>());
  result.fx = camera["focal"][0].get<double>();
  result.fy = -camera["focal"][1].get<double>();
  result.cx = camera["resolution"][0].get<double>() / 2;
  result.cy = camera["resolution"][1].get<double>() / 2;
  if (const auto principal = camera.find("principal"); principal != camera.end()) {
    result.cx = (*principal)[0].get<double>();
    result.cy = (*principal)[1].get<double>();
  }
  std::array<double, 3> factors{};
  if (const auto distortion = camera.find("distortion"); distortion != camera.end()) {
    for (std::size_t i = 0; i < distortion->size(); ++i) {
      factors.at(i) = (*distortion)[i].get<double>();
    }
  }
  if (result.projection == Projection::kPinhole) {
    result.distortion = {.k1 = factors[0], .k2 = factors[1], .k3 = factors[2]};
  } else {
    result.radial_distortion = {factors[0], factors[1], factors[2], 0};
    if (camera.contains("fov")) result.half_angle = camera["fov"].get<double>();
  }
  return result;
}

class FacebookRigFormat : public RigFormat {
 public:
  std::string_view name() const override { return "facebook360"; }
  std::string_view description() const override {
    return "rig.json of facebook360_dep and Surround360";
  }
  std::vector<std::string> files() const override { return {"rig.json"}; }
  std::vector<std::string> picture_folders() const override {
    return {"", "color", "video/color", "../color", "../video/color"};  // PROJECT/rigs/rig.json
  }
  bool matches(const JsonOutline& outline) const override {
    const bool rig = outline.has("cameras") && !outline.has("frames");
    const bool camera = outline.has("origin") && outline.has("forward");
    return !outline.is_list && !outline.has("schema") && (rig || camera);
  }
  ForeignRig parse(std::span<const NamedText> files,
                   const PictureSizeReader& size_of_picture) const override;
  ExportedRig format(const schemas::RigDocument& rig) const override;
};

schemas::CameraGeometry facebook_camera(const json& camera, const std::string& name,
                                        const std::string& pointer) {
  schemas::CameraGeometry result;
  result.id = camera["id"].get<std::string>();
  result.width = camera["resolution"][0].get<int>();
  result.height = camera["resolution"][1].get<int>();
  result.intrinsics = facebook_intrinsics(camera);
  if (!(result.intrinsics.fx > 0 && result.intrinsics.fy > 0)) {
    throw schemas::json_value_error(
        name, schemas::append_json_pointer(pointer, "focal"),
        fmt::format("found {}, allowed: [fx, -fy], the first greater and the second less than 0",
                    camera["focal"].dump()),
        "Give square pixels as [f, -f]: the file's y axis points up, that of pictures down");
  }
  rig::Pose pose;
  pose.position = vector_from(camera["origin"]);
  pose.world_from_camera_rotation << vector_from(camera["right"]), vector_from(camera["up"]),
      -vector_from(camera["forward"]);
  constexpr double kTolerance = 1e-3;  // as facebook360_dep
  std::string problem;
  if (!make_rotation(pose.world_from_camera_rotation, kTolerance, problem)) {
    throw schemas::json_value_error(
        name, pointer, fmt::format("{} (\"right\", \"up\" and \"forward\")", problem),
        "Give three unit vectors at right angles, with forward = up x right");
  }
  result.world_from_camera = rig::matrix_from_pose(pose);
  return result;
}

ForeignRig FacebookRigFormat::parse(std::span<const NamedText> files,
                                    const PictureSizeReader& /*size_of_picture*/) const {
  const std::string& name = files[0].name;
  const json document = schemas::parse_json(files[0].text, name);
  check_facebook_schema(document, name);
  const bool single = is_single_camera(document);
  const std::size_t count = single ? 1 : document["cameras"].size();
  ForeignRig rig;
  std::set<std::string> seen;
  std::size_t ignored_angles = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const json& camera = single ? document : document["cameras"][i];
    const std::string pointer = single ? "" : schemas::append_json_pointer("/cameras", i);
    rig.cameras.push_back(
        {.geometry = facebook_camera(camera, name, pointer), .place = name + "#" + pointer});
    const std::string& id = rig.cameras.back().geometry.id;
    if (!seen.insert(id).second) {
      throw schemas::json_value_error(name, schemas::append_json_pointer(pointer, "id"),
                                      fmt::format("the id \"{}\" is used twice", id),
                                      "Give each camera a unique id");
    }
    const bool pinhole = rig.cameras.back().geometry.intrinsics.projection == Projection::kPinhole;
    if (pinhole && camera.contains("fov")) ++ignored_angles;
  }
  if (ignored_angles > 0) {
    rig.notes.push_back(
        fmt::format("\"fov\" of {} RECTILINEAR cameras is ignored: their whole pictures are used",
                    ignored_angles));
  }
  return rig;
}

/// Returns the three factors of the distortion. Throws Error (bad input) if that is not all.
json distortion_for_facebook(const schemas::CameraGeometry& camera) {
  const schemas::Intrinsics& lens = camera.intrinsics;
  if (lens.projection == Projection::kPinhole) {
    const schemas::Distortion& d = lens.distortion;
    if (d.p1 != 0 || d.p2 != 0) {
      throw lens_error(camera, "rig.json has no tangential distortion (p1, p2)",
                       "Calibrate the lens without p1 and p2, or choose another format");
    }
    return {d.k1, d.k2, d.k3};
  }
  const auto& k = lens.radial_distortion;
  if (k[3] != 0) {
    throw lens_error(camera, "rig.json has three factors of the distortion, the lens has four",
                     "Calibrate the lens without k4, or choose another format");
  }
  return {k[0], k[1], k[2]};
}

ExportedRig FacebookRigFormat::format(const schemas::RigDocument& rig) const {
  auto cameras = nlohmann::ordered_json::array();
  for (const schemas::RigDocument::Camera& entry : rig.cameras) {
    const schemas::CameraGeometry& camera = entry.geometry;
    const schemas::Intrinsics& lens = camera.intrinsics;
    const schemas::Matrix4& m = camera.world_from_camera;
    nlohmann::ordered_json object{{"version", 1},
                                  {"type", type_of_projection(lens.projection)},
                                  {"id", camera.id},
                                  {"origin", {m[3], m[7], m[11]}},
                                  {"right", {m[0], m[4], m[8]}},
                                  {"up", {m[1], m[5], m[9]}},
                                  {"forward", {-m[2], -m[6], -m[10]}},
                                  {"resolution", {camera.width, camera.height}},
                                  {"focal", {lens.fx, -lens.fy}},
                                  {"principal", {lens.cx, lens.cy}},
                                  {"distortion", distortion_for_facebook(camera)}};
    if (lens.half_angle) object["fov"] = *lens.half_angle;
    cameras.push_back(std::move(object));
  }
  return {{{"rig.json", schemas::format_json({{"cameras", std::move(cameras)}})}},
          losses_of(rig, {.half_angle = true})};
}

}  // namespace

const RigFormat& facebook_rig_format() {
  static const FacebookRigFormat kFormat;
  return kFormat;
}

}  // namespace raystage::ingest
