// SPDX-License-Identifier: Apache-2.0
// Converts a NeRF transforms.json. Focal lengths come from fl_x and fl_y in pixels, or from the
// angles of a pinhole: fl = size / (2 tan(angle / 2)). transform_matrix is world_from_camera (y up,
// -z forward). Its uniform scale, the cube root of the determinant, is removed. Pixel centres are
// at +0.5 (nerfstudio, Cameras.get_image_coords()). Cost: linear in the frames, and one file header
// per frame without a size.
#include "ingest/rig_formats/nerf_transforms.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "ingest/rig_formats/camera_ids.h"
#include "ingest/rig_formats/rig_conversion.h"
#include "schemas/json_text.h"
#include "schemas/validator.h"

namespace raystage::ingest {
namespace {

using nlohmann::json;

// The properties that are read; all others are ignored.
constexpr const char* kSchema = R"({
  "$defs": {
    "number": {"type": "number"},
    "focal": {"type": "number", "exclusiveMinimum": 0, "maximum": 10000000},
    "angle": {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 3.141592653589793},
    "size": {"type": "integer", "minimum": 1, "maximum": 65535},
    "centre": {"type": "number", "minimum": -10000000, "maximum": 10000000},
    "coefficient": {"type": "number", "minimum": -1000000, "maximum": 1000000},
    "camera_model": {"enum": ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "OPENCV_FISHEYE"]},
    "camera": {
      "type": "object",
      "properties": {
        "camera_angle_x": {"$ref": "#/$defs/angle"}, "camera_angle_y": {"$ref": "#/$defs/angle"},
        "fl_x": {"$ref": "#/$defs/focal"}, "fl_y": {"$ref": "#/$defs/focal"},
        "cx": {"$ref": "#/$defs/centre"}, "cy": {"$ref": "#/$defs/centre"},
        "w": {"$ref": "#/$defs/size"}, "h": {"$ref": "#/$defs/size"},
        "k1": {"$ref": "#/$defs/coefficient"}, "k2": {"$ref": "#/$defs/coefficient"},
        "k3": {"$ref": "#/$defs/coefficient"}, "k4": {"$ref": "#/$defs/coefficient"},
        "p1": {"$ref": "#/$defs/coefficient"}, "p2": {"$ref": "#/$defs/coefficient"},
        "camera_model": {"$ref": "#/$defs/camera_model"}, "is_fisheye": {"type": "boolean"}
      }
    },
    "frame": {
      "type": "object",
      "required": ["file_path", "transform_matrix"],
      "properties": {
        "file_path": {"type": "string", "minLength": 1, "maxLength": 4000},
        "transform_matrix": {
          "type": "array", "minItems": 3, "maxItems": 4,
          "items": {"type": "array", "minItems": 4, "maxItems": 4,
                    "items": {"type": "number", "minimum": -1000000000, "maximum": 1000000000}}
        }
      }
    }
  },
  "type": "object",
  "required": ["frames"],
  "properties": {"frames": {"type": "array", "minItems": 1, "maxItems": 10000,
                            "items": {"$ref": "#/$defs/frame"}}}
})";

void check_schema(const json& document, std::string_view name) {
  const json schema = json::parse(kSchema);
  schemas::SchemaValidator(schema).validate(document, name);
  // Camera properties may be at the top level; those of a frame override them.
  json camera = schema["$defs"]["camera"];
  camera["$defs"] = schema["$defs"];
  const schemas::SchemaValidator camera_validator(std::move(camera));
  camera_validator.validate(document, name);
  for (std::size_t i = 0; i < document["frames"].size(); ++i) {
    try {
      camera_validator.validate(document["frames"][i], "");
    } catch (const Error& error) {  // its JSON pointer starts at the frame: "#/fl_x"
      throw schemas::json_value_error(
          name, schemas::append_json_pointer("/frames", i) + error.where().substr(1),
          error.what_happened(), error.what_to_do());
    }
  }
}

/// Looks up a property in one frame, then at the top level of the document.
class FrameProperties {
 public:
  FrameProperties(const json& document, const json& frame) : document_(document), frame_(frame) {}

  std::optional<double> number(const char* key) const {
    const json* found = find(key);
    return found == nullptr ? std::nullopt : std::optional(found->get<double>());
  }
  double number(const char* key, double fallback) const { return number(key).value_or(fallback); }
  bool is_fisheye() const {
    const json* model = find("camera_model");
    const json* flag = find("is_fisheye");
    return (model != nullptr && *model == "OPENCV_FISHEYE") || (flag != nullptr && *flag == true);
  }

 private:
  const json* find(const char* key) const {
    for (const json* object : {&frame_, &document_}) {
      const auto found = object->find(key);
      if (found != object->end()) return &*found;
    }
    return nullptr;
  }

  const json& document_;
  const json& frame_;
};

/// Sets the distortion. Throws Error (bad input) for a coefficient that the lens does not have.
void set_distortion(schemas::Intrinsics& lens, const FrameProperties& frame,
                    const std::string& name, const std::string& pointer) {
  const bool fisheye = lens.projection == schemas::Projection::kFisheye;
  for (const char* key : {"p1", "p2", "k4"}) {
    const double value = frame.number(key, 0);
    const bool is_known = fisheye == (key == std::string_view("k4"));
    if (value == 0 || is_known) continue;
    throw schemas::json_value_error(
        name, pointer, fmt::format("found \"{}\" {}, allowed for the camera_model: 0", key, value),
        "Set it to 0, or correct \"camera_model\"");
  }
  const double k1 = frame.number("k1", 0), k2 = frame.number("k2", 0), k3 = frame.number("k3", 0);
  if (fisheye) {
    lens.radial_distortion = {k1, k2, k3, frame.number("k4", 0)};
  } else {
    lens.distortion = {
        .k1 = k1, .k2 = k2, .p1 = frame.number("p1", 0), .p2 = frame.number("p2", 0), .k3 = k3};
  }
}

schemas::Intrinsics intrinsics_of(const FrameProperties& frame, PictureSize size,
                                  const std::string& name, const std::string& pointer) {
  const auto focal = [&](double pixels, double angle) {
    const double length = pixels / 2 / std::tan(angle / 2);
    constexpr double kLargest = 1e7;  // of rig.json
    if (length <= kLargest) return length;
    throw schemas::json_value_error(
        name, pointer,
        fmt::format(
            "the camera's angle {} means a focal length of {:.3g} pixels, allowed: up to {}", angle,
            length, kLargest),
        "Give the angle in radians");
  };
  schemas::Intrinsics result;
  const bool fisheye = frame.is_fisheye();
  if (fisheye) result.projection = schemas::Projection::kFisheye;
  if (const auto fl_x = frame.number("fl_x")) {
    result.fx = *fl_x;
  } else if (const auto angle = frame.number("camera_angle_x"); angle && !fisheye) {
    result.fx = focal(size.width, *angle);
  } else {
    throw schemas::json_value_error(
        name, pointer,
        fisheye ? "a fisheye needs \"fl_x\" (pixels), which is not given"
                : "neither \"fl_x\" (pixels) nor \"camera_angle_x\" (radians) is given",
        "Add it to the frame or to the whole file");
  }
  result.fy = result.fx;
  if (const auto fl_y = frame.number("fl_y")) {
    result.fy = *fl_y;
  } else if (const auto angle = frame.number("camera_angle_y"); angle && !fisheye) {
    result.fy = focal(size.height, *angle);
  }
  result.cx = frame.number("cx", size.width / 2.0);
  result.cy = frame.number("cy", size.height / 2.0);
  set_distortion(result, frame, name, pointer);
  return result;
}

/// Returns the matrix without its uniform scale and rounding errors. Throws for other deviations.
schemas::Matrix4 pose_of(const json& matrix, const std::string& name, const std::string& pointer) {
  Eigen::Matrix3d axes;
  rig::Pose pose;
  for (Eigen::Index row = 0; row < 3; ++row) {
    const json& values = matrix[row];
    for (Eigen::Index column = 0; column < 3; ++column) {
      axes(row, column) = values[column].get<double>();
    }
    pose.position[row] = values[3].get<double>();
  }
  const double scale = std::cbrt(axes.determinant());
  constexpr double kSmallest = 1e-9, kTolerance = 1e-3;
  if (!(scale > kSmallest)) {
    throw schemas::json_value_error(name, pointer,
                                    "the matrix mirrors or is singular, allowed: a rotation",
                                    "Use right-handed axes: camera x right, y up, looking down -z");
  }
  axes /= scale;
  const double off = (axes.transpose() * axes - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (off > kTolerance) {
    throw schemas::json_value_error(
        name, pointer,
        fmt::format("the matrix is skewed or scaled unevenly by {:.3g}, allowed: a "
                    "rotation with one scale",
                    off),
        "Export rigid poses, without skew and with one scale");
  }
  pose.world_from_camera_rotation = Eigen::Quaterniond(axes).normalized().toRotationMatrix();
  return rig::matrix_from_pose(pose);
}

/// Returns w and h, or else the size of the picture.
PictureSize size_of_frame(const FrameProperties& frame, const ForeignRig::Camera& camera,
                          const PictureSizeReader& size_of_picture) {
  const auto width = frame.number("w"), height = frame.number("h");
  if (width && height) return {static_cast<int>(*width), static_cast<int>(*height)};
  if (size_of_picture) return size_of_picture(camera.image, camera.place);
  throw Error::bad_input("\"w\" and \"h\" (pixels) are not given, and there are no pictures",
                         camera.place, "Add both to the frame or to the whole file");
}

/// Returns the camera_model of all lenses. Throws Error (bad input) if there is none.
std::string_view camera_model_of(const schemas::RigDocument& rig) {
  const auto model_of = [](const schemas::CameraGeometry& camera) -> std::string_view {
    switch (camera.intrinsics.projection) {
      case schemas::Projection::kPinhole:
        return "OPENCV";
      case schemas::Projection::kFisheye:
      case schemas::Projection::kFtheta:
        return "OPENCV_FISHEYE";
      default:
        throw lens_error(camera, "transforms.json has only OpenCV's fisheye",
                         "Choose another format");
    }
  };
  std::string_view model = "OPENCV";
  for (const schemas::RigDocument::Camera& camera : rig.cameras) {
    const std::string_view own = model_of(camera.geometry);
    if (&camera == &rig.cameras.front()) model = own;
    if (own == model) continue;
    throw lens_error(camera.geometry,
                     fmt::format("the first camera has the camera_model {}, this one {}, and "
                                 "transforms.json has one for all",
                                 model, own),
                     "Export the pinholes and the fisheyes as two rigs, or choose another format");
  }
  return model;
}

nlohmann::ordered_json frame_for_nerf(const schemas::CameraGeometry& camera) {
  const schemas::Intrinsics& lens = camera.intrinsics;
  const schemas::Matrix4& m = camera.world_from_camera;
  nlohmann::ordered_json frame{{"file_path", fmt::format("images/{}.jpg", camera.id)},
                               {"w", camera.width},
                               {"h", camera.height},
                               {"fl_x", lens.fx},
                               {"fl_y", lens.fy},
                               {"cx", lens.cx},
                               {"cy", lens.cy}};
  if (lens.projection == schemas::Projection::kPinhole) {
    const schemas::Distortion& d = lens.distortion;
    frame.update({{"k1", d.k1}, {"k2", d.k2}, {"p1", d.p1}, {"p2", d.p2}, {"k3", d.k3}});
  } else {
    const auto& k = lens.radial_distortion;
    frame.update({{"k1", k[0]}, {"k2", k[1]}, {"k3", k[2]}, {"k4", k[3]}});
  }
  auto rows = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < m.size(); i += 4) {
    rows.push_back(nlohmann::ordered_json::array({m[i], m[i + 1], m[i + 2], m[i + 3]}));
  }
  frame["transform_matrix"] = std::move(rows);
  return frame;
}

class NerfFormat : public RigFormat {
 public:
  std::string_view name() const override { return "nerf"; }
  std::string_view description() const override {
    return "transforms.json of NeRF, instant-ngp and nerfstudio";
  }
  std::vector<std::string> files() const override { return {"transforms.json"}; }
  std::vector<std::string> picture_folders() const override { return {""}; }
  bool matches(const JsonOutline& outline) const override {
    return !outline.is_list && outline.has("frames") && !outline.has("schema");
  }
  ForeignRig parse(std::span<const NamedText> files,
                   const PictureSizeReader& size_of_picture) const override;
  ExportedRig format(const schemas::RigDocument& rig) const override;
};

ForeignRig NerfFormat::parse(std::span<const NamedText> files,
                             const PictureSizeReader& size_of_picture) const {
  const std::string& name = files[0].name;
  const json document = schemas::parse_json(files[0].text, name);
  check_schema(document, name);
  const json& frames = document["frames"];
  std::vector<std::string> names;
  for (const json& frame : frames) {
    names.push_back(frame["file_path"].get<std::string>());
    if (!has_control_characters(names.back())) continue;
    throw schemas::json_value_error(
        name,
        schemas::append_json_pointer(schemas::append_json_pointer("/frames", names.size() - 1),
                                     "file_path"),
        "the name has control characters", "Rename the picture");
  }
  const std::vector<std::string> ids = make_camera_ids(names);
  ForeignRig rig;
  rig.arbitrary_scale = true;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::string pointer = schemas::append_json_pointer("/frames", i);
    ForeignRig::Camera camera;
    camera.image = names[i];
    camera.place = name + "#" + schemas::append_json_pointer(pointer, "file_path");
    const FrameProperties properties(document, frames[i]);
    const PictureSize size = size_of_frame(properties, camera, size_of_picture);
    schemas::CameraGeometry& geometry = camera.geometry;
    geometry.id = ids[i];
    geometry.width = size.width;
    geometry.height = size.height;
    geometry.intrinsics = intrinsics_of(properties, size, name, pointer);
    geometry.world_from_camera = pose_of(frames[i]["transform_matrix"], name,
                                         schemas::append_json_pointer(pointer, "transform_matrix"));
    rig.cameras.push_back(std::move(camera));
  }
  return rig;
}

ExportedRig NerfFormat::format(const schemas::RigDocument& rig) const {
  const std::string_view model = camera_model_of(rig);
  nlohmann::ordered_json document{{"camera_model", model}};
  auto frames = nlohmann::ordered_json::array();
  for (const auto& camera : rig.cameras) frames.push_back(frame_for_nerf(camera.geometry));
  document["frames"] = std::move(frames);
  return {{{"transforms.json", schemas::format_json(document)}}, losses_of(rig, {})};
}

}  // namespace

const RigFormat& nerf_format() {
  static const NerfFormat kFormat;
  return kFormat;
}

}  // namespace raystage::ingest
