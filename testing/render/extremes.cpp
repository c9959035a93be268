// SPDX-License-Identifier: Apache-2.0
#include "testing/render/extremes.h"

#include <Eigen/Geometry>
#include <cstddef>
#include <numbers>
#include <stdexcept>

namespace raystage::testing {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kFarOff = 1e7;  // metres from the world's origin
const Eigen::Vector3d kEye(0.01, 0.013, 0.1);
const Eigen::Vector4d kPainted(0, 0, 1, 4);

std::vector<schemas::CameraGeometry> grid(int rows, int columns) {
  return camera_grid(rows, columns, 0.06, 64, 48);
}

void place(schemas::CameraGeometry& camera, double x, double y) {
  camera.world_from_camera[3] = x;
  camera.world_from_camera[7] = y;
  camera.row = camera.column = std::nullopt;
}

struct ViewAt {
  Eigen::Vector3d eye = kEye;
  double fov_degrees = 50;
  double yaw_degrees = 0;
  int width = 24, height = 18;
};

render::VirtualCamera view_of(const ViewAt& at) {
  rig::Pose pose;
  pose.position = at.eye;
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(at.yaw_degrees * kDegree, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return render::virtual_camera_with_fov(at.width, at.height, at.fov_degrees * kDegree, pose);
}

ExtremeView of_grid(const std::string& name, const ViewAt& at,
                    const Eigen::Vector4d& plane = kPainted, bool blank = false) {
  return {name, "grid", view_of(at), plane, blank};
}

/// Returns the view in the world of the array "far off".
ExtremeView far_off(const ExtremeView& near) {
  ExtremeView far = near;
  far.name += ", 1e7 m off";
  far.array = "far off";
  far.view.pose.position += Eigen::Vector3d::Constant(kFarOff);
  far.plane.w() -= near.plane.head<3>().sum() * kFarOff;
  return far;
}

void add_eyes(std::vector<ExtremeView>& all) {
  all.push_back(of_grid("ordinary", {}));
  all.push_back(of_grid("on the array plane", {{0.01, 0.013, 0}}));
  all.push_back(of_grid("1e-12 m behind it", {{0.01, 0.013, 1e-12}}));
  all.push_back(of_grid("1e-12 m before it", {{0.01, 0.013, -1e-12}}));
  all.push_back(of_grid("on it, looking along", {{0.01, 0.013, 0}, 150, 100}));
  all.push_back(of_grid("1e-12 m off, looking along", {{0.01, 0.013, 1e-12}, 150, 100}));
  all.push_back(of_grid("in a camera's place", {{0.06, 0, 0}}));
  all.push_back(of_grid("on an edge", {{0.02, 0, 0}}));
  all.push_back(of_grid("rays through a vertex and edges", {{0, 0, 0.1}, 50, 0, 25, 19}));
  all.push_back(of_grid("in front", {{0.01, 0.013, -0.3}, 10}));
  all.push_back(of_grid("1 m behind", {{0.01, 0.013, 1}, 6}));
  all.push_back(of_grid("1e6 m behind", {{0.01, 0.013, 1e6}, 8e-6}));
  all.push_back(of_grid("1e6 m behind, 16384 px", {{0.01, 0.013, 1e6}, 0.01, 0, 16384, 1}));
}

void add_planes(std::vector<ExtremeView>& all) {
  constexpr double kEdgeOn = 0.5;  // metres below the axis
  all.push_back(of_grid("focus 1e-3 m ahead", {{0, 0, 1e-4}}, {0, 0, 1, 9e-4}));
  all.push_back(of_grid("focus tilted, 1e-3 m ahead", {{0, 0, 1e-4}}, {0.3, -0.2, 1, 9e-4}));
  all.push_back(of_grid("focus at 1e9 m", {}, {0, 0, 1, 1e9}));
  all.push_back(of_grid("focus at infinity", {}, {0, 0, 0, 1}));
  all.push_back(of_grid("focus edge-on", {}, {0, 1, 0, kEdgeOn}));
  all.push_back(of_grid("focus edge-on through the eye", {}, {0, 1, 0, -kEye.y()}, true));
  all.push_back(of_grid("focus through the eye", {}, {0, 0, 1, -kEye.z()}, true));
  all.push_back(of_grid("focus tilted through the eye", {},
                        {0.1, 0.2, 0.3, -(0.1 * kEye.x() + 0.2 * kEye.y() + 0.3 * kEye.z())},
                        true));
}

void add_images(std::vector<ExtremeView>& all) {
  all.push_back(of_grid("field of view 0.01 degrees", {kEye, 0.01}));
  all.push_back(of_grid("field of view 179 degrees", {{0.01, 0.013, 0}, 179, 0, 25, 19}));
  all.push_back(of_grid("179 degrees, 16384 px", {{0.01, 0.013, 0}, 179, 0, 16384, 2}));
  all.push_back(of_grid("16384 px", {kEye, 50, 3, 16384, 2}));
  all.push_back(of_grid("1 x 1 px", {kEye, 50, 0, 1, 1}));
}

void add_arrays(std::vector<ExtremeView>& all) {
  for (const char* array : {"flat", "double", "row", "diagonal", "coincident", "single"}) {
    all.push_back({std::string(array) + " array", array, view_of({{0.01, 0.005, 0.02}}), kPainted});
  }
  all.push_back({"row, in its line", "row", view_of({{0.01, 0, 0}}), kPainted});
}

}  // namespace

SyntheticTake make_extreme_array(const std::string& name) {
  SyntheticTake take;
  take.cameras = grid(3, 3);
  if (name == "flat") {
    take.depth_range = schemas::DepthRange{take.plane_depth, take.plane_depth};
  } else if (name == "far off") {
    take.origin = {kFarOff, kFarOff, kFarOff};
  } else if (name == "double") {
    place(take.cameras[5], 0, 0);
  } else if (name == "row") {
    take.cameras = grid(1, 4);
  } else if (name == "diagonal") {
    take.cameras = grid(1, 4);
    for (std::size_t i = 0; i < 4; ++i) {
      place(take.cameras[i], 0.05 * static_cast<double>(i) - 0.07,
            0.03 * static_cast<double>(i) - 0.04);
    }
  } else if (name == "coincident") {
    take.cameras = grid(1, 3);
    for (schemas::CameraGeometry& camera : take.cameras) place(camera, 0.01, 0.02);
  } else if (name == "single") {
    take.cameras = grid(1, 1);
  } else if (name != "grid") {
    throw std::logic_error("there is no array called " + name);
  }
  return take;
}

std::vector<ExtremeView> extremes() {
  std::vector<ExtremeView> all;
  add_eyes(all);
  add_planes(all);
  add_images(all);
  const std::vector<ExtremeView> of_the_grid = all;
  add_arrays(all);
  for (const ExtremeView& near : of_the_grid) all.push_back(far_off(near));
  return all;
}

}  // namespace raystage::testing
