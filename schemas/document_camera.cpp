// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "schemas/fields.h"
#include "schemas/projection_names.h"

namespace raystage::schemas {
namespace {

using nlohmann::ordered_json;

// Matrices printed with six digits per number, as by many surveys, are within this.
constexpr double kRigidTolerance = 1e-4;

constexpr auto kProjectionNames =
    enum_names<Projection>("pinhole", "fisheye", "ftheta", "equisolid", "orthographic");
constexpr Fields kDistortion(custom([](const JsonNode&, Distortion&) {},
                                    [](const Distortion&, ordered_json& object) {
                                      object["model"] = "brown_conrady";
                                    }),
                             defaulted("k1", &Distortion::k1), defaulted("k2", &Distortion::k2),
                             defaulted("p1", &Distortion::p1), defaulted("p2", &Distortion::p2),
                             defaulted("k3", &Distortion::k3));
std::array<double, 4> radial_distortion_from(const JsonNode& list) {
  std::array<double, 4> factors{};
  for (std::size_t i = 0; i < list.size(); ++i) factors[i] = list.at(i).get<double>();
  return factors;
}

ordered_json terms_of(const std::array<double, 4>& factors) { return ordered_json(factors); }

/// A distortion of another projection would be ignored.
void check_projection(const JsonNode& object, const Intrinsics& intrinsics) {
  if (intrinsics.projection == Projection::kPinhole) {
    for (const char* property : {"radial_distortion", "half_angle"}) {
      if (!object.has(property)) continue;
      throw object.at(property).input_error(
          "a pinhole has this property, allowed: only with \"projection\": \"fisheye\", "
          "\"ftheta\", \"equisolid\" or \"orthographic\"",
          "Give the projection, or remove the property");
    }
  } else if (object.has("distortion")) {
    throw object.at("distortion")
        .input_error(
            "a fisheye lens has the distortion of a pinhole, allowed: "
            "\"radial_distortion\"",
            "Use \"radial_distortion\", or remove the projection");
  }
}

constexpr Fields kIntrinsics(required("fx", &Intrinsics::fx), required("fy", &Intrinsics::fy),
                             required("cx", &Intrinsics::cx), required("cy", &Intrinsics::cy),
                             optional("distortion", &Intrinsics::distortion, kDistortion),
                             optional("projection", &Intrinsics::projection, kProjectionNames),
                             optional("radial_distortion", &Intrinsics::radial_distortion,
                                      Converter(radial_distortion_from, terms_of)),
                             optional("half_angle", &Intrinsics::half_angle),
                             check(check_projection));

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
            "the matrix is not rigid: its axes are scaled or skewed, with an error of {:.3g}, "
            "allowed: up to {}",
            worst, kRigidTolerance),
        "Remove the scale from the rotation, or give more digits");
  }
  if (determinant < 0) {
    throw matrix.input_error("the matrix is a reflection (determinant -1), allowed: a rotation",
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

ordered_json rows_of(const Matrix4& matrix) {
  ordered_json rows = ordered_json::array();
  for (std::size_t i = 0; i < 16; i += 4) {
    rows.push_back({matrix[i], matrix[i + 1], matrix[i + 2], matrix[i + 3]});
  }
  return rows;
}

void check_grid_position(const JsonNode& object, const CameraGeometry&) {
  if (object.has("row") == object.has("col")) return;
  throw object.input_error("found only one of \"row\" and \"col\", allowed: both or neither",
                           "Add the missing property");
}

constexpr Fields kCameraGeometry(required("id", &CameraGeometry::id),
                                 required("width", &CameraGeometry::width),
                                 required("height", &CameraGeometry::height),
                                 required("intrinsics", &CameraGeometry::intrinsics, kIntrinsics),
                                 required("world_from_camera", &CameraGeometry::world_from_camera,
                                          Converter(pose_from, rows_of)),
                                 check(check_grid_position), optional("row", &CameraGeometry::row),
                                 optional("col", &CameraGeometry::column),
                                 optional("line_time_us", &CameraGeometry::line_time_us));

}  // namespace

std::string_view name_of(Projection projection) { return kProjectionNames.name(projection); }

std::span<const Projection> projections() {
  static constexpr auto kAll = [] {
    std::array<Projection, kProjectionNames.names.size()> all{};
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<Projection>(i);
    return all;
  }();
  return kAll;
}

CameraGeometry camera_from(const JsonNode& object) {
  return kCameraGeometry.make<CameraGeometry>(object);
}

bool is_plain_camera(const CameraGeometry& camera) {
  return camera.intrinsics.projection == Projection::kPinhole && camera.line_time_us == 0;
}

nlohmann::ordered_json json_from(const CameraGeometry& camera) {
  return kCameraGeometry.write(camera);
}

}  // namespace raystage::schemas
