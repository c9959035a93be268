// SPDX-License-Identifier: Apache-2.0
#include "ingest/nerf_transforms.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "ingest/source_image.h"
#include "rig/pose.h"
#include "schemas/json_text.h"
#include "schemas/validator.h"

// Converts a NeRF transforms.json. Focal lengths come from fl_x and fl_y in pixels, or from the
// angles: fl = size / (2 tan(angle / 2)). transform_matrix is world_from_camera (y up, -z forward).
// Its uniform scale, the cube root of the determinant, is removed. Cost: linear in the frames, and
// one file header per frame without a size.

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
    "camera_model": {"enum": ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE"]},
    "camera": {
      "type": "object",
      "properties": {
        "camera_angle_x": {"$ref": "#/$defs/angle"}, "camera_angle_y": {"$ref": "#/$defs/angle"},
        "fl_x": {"$ref": "#/$defs/focal"}, "fl_y": {"$ref": "#/$defs/focal"},
        "cx": {"$ref": "#/$defs/centre"}, "cy": {"$ref": "#/$defs/centre"},
        "w": {"$ref": "#/$defs/size"}, "h": {"$ref": "#/$defs/size"},
        "k1": {"$ref": "#/$defs/coefficient"}, "k2": {"$ref": "#/$defs/coefficient"},
        "k3": {"$ref": "#/$defs/coefficient"}, "k4": {"const": 0},
        "p1": {"$ref": "#/$defs/coefficient"}, "p2": {"$ref": "#/$defs/coefficient"},
        "camera_model": {"$ref": "#/$defs/camera_model"}, "is_fisheye": {"const": false}
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
  "properties": {"frames": {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/frame"}}}
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
    for (const json* object : {&frame_, &document_}) {
      const auto found = object->find(key);
      if (found != object->end()) return found->get<double>();
    }
    return std::nullopt;
  }
  double number(const char* key, double fallback) const { return number(key).value_or(fallback); }

 private:
  const json& document_;
  const json& frame_;
};

std::filesystem::path find_image(const std::filesystem::path& folder, const std::string& path,
                                 const std::string& name, const std::string& pointer) {
  std::error_code ignored;
  for (const char* extension :
       {"", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG", ".exr", ".tif", ".tiff"}) {
    const std::filesystem::path file = folder / (path + extension);
    if (std::filesystem::is_regular_file(file, ignored)) return file;
  }
  throw schemas::json_value_error(
      name, pointer,
      fmt::format("the image \"{}\" was not found, with or without an extension, in {}", path,
                  folder.string()),
      "Set the folder of the images")
      .concerning({"images"});
}

schemas::Intrinsics intrinsics_of(const FrameProperties& frame, SourceImageSize size,
                                  const std::string& name, const std::string& pointer) {
  const auto focal = [](double pixels, double angle) { return pixels / 2 / std::tan(angle / 2); };
  schemas::Intrinsics result;
  if (const auto fl_x = frame.number("fl_x")) {
    result.fx = *fl_x;
  } else if (const auto angle = frame.number("camera_angle_x")) {
    result.fx = focal(size.width, *angle);
  } else {
    throw schemas::json_value_error(
        name, pointer, "neither \"fl_x\" (pixels) nor \"camera_angle_x\" (radians) is given",
        "Add one of them to the frame or to the whole file");
  }
  result.fy = result.fx;
  if (const auto fl_y = frame.number("fl_y")) {
    result.fy = *fl_y;
  } else if (const auto angle = frame.number("camera_angle_y")) {
    result.fy = focal(size.height, *angle);
  }
  result.cx = frame.number("cx", size.width / 2.0);
  result.cy = frame.number("cy", size.height / 2.0);
  result.distortion = {.k1 = frame.number("k1", 0),
                       .k2 = frame.number("k2", 0),
                       .p1 = frame.number("p1", 0),
                       .p2 = frame.number("p2", 0),
                       .k3 = frame.number("k3", 0)};
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

}  // namespace

schemas::ImportManifest read_nerf_transforms(const std::filesystem::path& file,
                                             std::string_view text,
                                             const ModelImportOptions& options) {
  const std::string name = file.string();
  const json document = schemas::parse_json(text, name);
  check_schema(document, name);
  const json& frames = document["frames"];
  const std::filesystem::path folder = options.images.value_or(file.parent_path());

  schemas::ImportManifest manifest = make_model_manifest(file, options);
  const images::ImageReader reader;
  std::vector<std::string> names;
  for (const json& frame : frames) names.push_back(frame["file_path"].get<std::string>());
  const std::vector<std::string> ids = make_camera_ids(names);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::string pointer = schemas::append_json_pointer("/frames", i);
    const std::filesystem::path image =
        find_image(folder, names[i], name, schemas::append_json_pointer(pointer, "file_path"));
    const FrameProperties properties(document, frames[i]);
    SourceImageSize size;
    if (properties.number("w") && properties.number("h")) {
      size = {static_cast<int>(*properties.number("w")), static_cast<int>(*properties.number("h"))};
    } else {
      size = image_size(reader, image);
    }
    schemas::ImportManifest::Camera camera;
    camera.geometry = {
        .id = ids[i],
        .width = size.width,
        .height = size.height,
        .intrinsics = intrinsics_of(properties, size, name, pointer),
        .world_from_camera = pose_of(frames[i]["transform_matrix"], name,
                                     schemas::append_json_pointer(pointer, "transform_matrix")),
        .row = std::nullopt,
        .column = std::nullopt};
    camera.frames.push_back({image.string(), 0});
    manifest.cameras.push_back(std::move(camera));
  }
  return manifest;
}

}  // namespace raystage::ingest
