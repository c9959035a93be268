// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "schemas/document.h"

namespace raystage {
namespace {

using nlohmann::ordered_json;

// Six digits a number, as surveys are often printed, keep within this.
constexpr double kRigidTolerance = 1e-4;

Distortion distortion_from(const JsonNode& object) {
  return {.k1 = object.get("k1", 0.0),
          .k2 = object.get("k2", 0.0),
          .p1 = object.get("p1", 0.0),
          .p2 = object.get("p2", 0.0),
          .k3 = object.get("k3", 0.0)};
}

Intrinsics intrinsics_from(const JsonNode& object) {
  Intrinsics result{.fx = object.at("fx").get<double>(),
                    .fy = object.at("fy").get<double>(),
                    .cx = object.at("cx").get<double>(),
                    .cy = object.at("cy").get<double>(),
                    .distortion = {}};
  if (object.has("distortion")) result.distortion = distortion_from(object.at("distortion"));
  return result;
}

void check_rigid(const Matrix4& m, const JsonNode& matrix) {
  const auto element = [&](std::size_t row, std::size_t column) { return m[row * 4 + column]; };
  if (element(3, 0) != 0 || element(3, 1) != 0 || element(3, 2) != 0 || element(3, 3) != 1) {
    throw matrix.at(3).input_error(
        fmt::format("found the last row {}, allowed: [0, 0, 0, 1]", matrix.at(3).value.dump()),
        "Write the matrix row by row, with the translation in the last column");
  }
  double worst = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b) {
      double dot = 0;
      for (std::size_t row = 0; row < 3; ++row) dot += element(row, a) * element(row, b);
      worst = std::max(worst, std::abs(dot - (a == b ? 1 : 0)));
    }
  }
  const double determinant =
      element(0, 0) * (element(1, 1) * element(2, 2) - element(1, 2) * element(2, 1)) -
      element(0, 1) * (element(1, 0) * element(2, 2) - element(1, 2) * element(2, 0)) +
      element(0, 2) * (element(1, 0) * element(2, 1) - element(1, 1) * element(2, 0));
  if (worst > kRigidTolerance) {
    throw matrix.input_error(
        fmt::format(
            "the matrix is not rigid: its axes are scaled or skewed, off by {:.3g}, allowed: "
            "a rotation within {}",
            worst, kRigidTolerance),
        "Remove the scale from the rotation, and give more digits");
  }
  if (determinant < 0) {
    throw matrix.input_error("the matrix mirrors (determinant -1), allowed: a rotation",
                             "Use right-handed axes: camera x right, y up, looking down -z");
  }
}

Matrix4 pose_from(const JsonNode& matrix) {
  Matrix4 result{};
  for (std::size_t row = 0; row < 4; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      result[row * 4 + column] = matrix.value[row][column].get<double>();
    }
  }
  check_rigid(result, matrix);
  return result;
}

}  // namespace

CameraGeometry camera_from(const JsonNode& object, std::set<std::string, std::less<>>& seen) {
  CameraGeometry camera{.id = unique_id_from(object, seen),
                        .width = object.at("width").get<int>(),
                        .height = object.at("height").get<int>(),
                        .intrinsics = intrinsics_from(object.at("intrinsics")),
                        .world_from_camera = pose_from(object.at("world_from_camera")),
                        .row = std::nullopt,
                        .column = std::nullopt};
  if (object.has("row") != object.has("col")) {
    throw object.input_error("found only one of \"row\" and \"col\", allowed: both or neither",
                             "Add the missing one");
  }
  if (object.has("row")) {
    camera.row = object.at("row").get<int>();
    camera.column = object.at("col").get<int>();
  }
  return camera;
}

nlohmann::ordered_json json_from(const CameraGeometry& camera) {
  const Intrinsics& k = camera.intrinsics;
  ordered_json intrinsics{{"fx", k.fx}, {"fy", k.fy}, {"cx", k.cx}, {"cy", k.cy}};
  if (const Distortion& d = k.distortion; d != Distortion{}) {
    intrinsics["distortion"] = {{"model", "brown_conrady"},
                                {"k1", d.k1},
                                {"k2", d.k2},
                                {"p1", d.p1},
                                {"p2", d.p2},
                                {"k3", d.k3}};
  }
  ordered_json rows = ordered_json::array();
  for (std::size_t row = 0; row < 4; ++row) {
    ordered_json values = ordered_json::array();
    for (std::size_t column = 0; column < 4; ++column) {
      values.push_back(camera.world_from_camera[row * 4 + column]);
    }
    rows.push_back(values);
  }
  ordered_json result{{"id", camera.id},
                      {"width", camera.width},
                      {"height", camera.height},
                      {"intrinsics", intrinsics},
                      {"world_from_camera", rows}};
  if (camera.row) result["row"] = *camera.row;
  if (camera.column) result["col"] = *camera.column;
  return result;
}

}  // namespace raystage
