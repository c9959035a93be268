// SPDX-License-Identifier: Apache-2.0
// The scenes that calibrate an array: a moving light, flat fields, a colour chart, a checkerboard.
#include <algorithm>
#include <cmath>

#include "rig/color_checker.h"
#include "simulate/scene.h"

namespace raystage::simulate {
namespace {

using Eigen::Isometry3f;
using Eigen::Vector3f;

/// Returns an empty scene without a lamp.
Scene make_empty_scene(const char* name, double focus, float sky, float ground, float background) {
  Scene scene;
  scene.name = name;
  scene.focus = focus;
  scene.light_colour = Vector3f::Zero();
  scene.sky_colour = Vector3f::Constant(sky);
  scene.ground_colour = Vector3f::Constant(ground);
  scene.background = Vector3f::Constant(background);
  return scene;
}

/// Returns the direction from the array at two angles, radians: to its axis, and about it.
Vector3f direction_at(double to_axis, double around) {
  return Eigen::Vector3d(std::sin(to_axis) * std::cos(around), std::sin(to_axis) * std::sin(around),
                         -std::cos(to_axis))
      .cast<float>();
}

/// Returns the tilt of a board that is shown to every side.
Eigen::Quaternionf board_tilt(double seconds) {
  return Eigen::AngleAxisf(0.65F * static_cast<float>(std::sin(0.9 * seconds + 0.3)),
                           Vector3f::UnitY()) *
         Eigen::AngleAxisf(0.6F * static_cast<float>(std::sin(1.3 * seconds + 2)),
                           Vector3f::UnitX()) *
         Eigen::AngleAxisf(0.3F * static_cast<float>(std::sin(0.5 * seconds)), Vector3f::UnitZ());
}

ScenePart make_bulb() {
  constexpr float kBulb = 0.011F;
  return {"light",
          make_sphere(kBulb, 24),
          {.colour = {0.9F, 0.86F, 0.8F}, .emission = 0.9F, .is_lamp = true},
          0};
}

/// Returns a board that follows a motion.
Scene make_board_scene(const Motion& motion) {
  Scene scene = make_empty_scene("board", 0.7, 0.75F, 0.7F, 0.1F);
  constexpr int kColumns = kSimulatedBoardColumns, kRows = kSimulatedBoardRows;
  scene.textures.emplace_back(1024, 1024, [](float u, float v) -> Vector3f {
    const float x = u * (kColumns + 2) - 1, y = v * (kRows + 2) - 1;
    const bool inside = x >= 0 && y >= 0 && x < kColumns && y < kRows;
    const bool is_black = inside && (static_cast<int>(x) + static_cast<int>(y)) % 2 == 0;
    return Vector3f::Constant(is_black ? 0.03F : 0.9F);
  });
  scene.motions.push_back(motion);
  constexpr float kSquare = kSimulatedSquareSize;
  const float width = kSquare * (kColumns + 2), height = kSquare * (kRows + 2);
  scene.parts.push_back({"board",
                         make_quad({-width / 2, height / 2, 0}, {width, 0, 0}, {0, -height, 0}),
                         {.texture = 0, .colour = {1, 1, 1}},
                         0});
  return scene;
}

}  // namespace

Scene make_moving_light_scene() {
  Scene scene = make_empty_scene("moving light", 2, 0.004F, 0.003F, 0.001F);

  // Covers near and far depths and the corners of every picture; no frequency divides another.
  scene.motions.push_back([](double seconds) {
    const double distance = 1.7 + 0.85 * std::sin(0.47 * seconds + 0.4);
    Isometry3f placement = Isometry3f::Identity();
    placement.translation() =
        Eigen::Vector3d(0.56 * distance * std::sin(1.31 * seconds),
                        0.40 * distance * std::sin(1.87 * seconds + 1), -distance)
            .cast<float>();
    return placement;
  });
  scene.parts.push_back(make_bulb());

  // Distractors: a window pane that reflects the light, and the lamp of a machine.
  scene.parts.push_back({"pane",
                         make_quad({1.5F, 1.2F, -1.2F}, {0, 0, -2.4F}, {0, -2.4F, 0}),
                         {.colour = {0.25F, 0.25F, 0.25F}, .mirror = true}});
  SceneMesh lamp;
  Isometry3f at = Isometry3f::Identity();
  at.translation() = Vector3f(-0.9F, -0.8F, -3.1F);
  lamp.add(make_sphere(0.009F, 16), at);
  scene.parts.push_back(
      {"machine's lamp", lamp, {.colour = {0.1F, 0.9F, 0.2F}, .emission = 0.7F, .is_lamp = true}});
  scene.parts.push_back({"wall",
                         make_quad({-4, 3, -3.6F}, {8, 0, 0}, {0, -6, 0}, {1, 1}, 4),
                         {.colour = {0.6F, 0.6F, 0.6F}}});
  return scene;
}

Scene make_surrounding_light_scene() {
  Scene scene = make_empty_scene("moving light", 2, 0.004F, 0.003F, 0.001F);
  // To every side of the array and behind its plane, near and far.
  scene.motions.push_back([](double seconds) {
    const double distance = 1.4 + 0.7 * std::sin(0.47 * seconds + 0.4);
    const double to_axis = 1.05 + 0.95 * std::sin(0.83 * seconds - 1);
    Isometry3f placement = Isometry3f::Identity();
    placement.translation() = static_cast<float>(distance) * direction_at(to_axis, 0.61 * seconds);
    return placement;
  });
  scene.parts.push_back(make_bulb());
  return scene;
}

Scene make_surrounding_checkerboard_scene() {
  return make_board_scene([](double seconds) {
    const double distance = 0.36 + 0.06 * std::sin(0.6 * seconds);
    const double to_axis = 0.95 + 0.85 * std::sin(0.7 * seconds - 1);
    const Vector3f towards = direction_at(to_axis, 0.9 * seconds);
    Isometry3f placement = Isometry3f::Identity();
    placement.translation() = static_cast<float>(distance) * towards;
    placement.rotate(Eigen::Quaternionf::FromTwoVectors(-Vector3f::UnitZ(), towards) *
                     board_tilt(seconds));
    return placement;
  });
}

Scene make_flat_field_scene(float light) {
  Scene scene = make_empty_scene("flat target", 1, 0, 0, 0);
  scene.parts.push_back({"target",
                         make_quad({-20, 20, -1}, {40, 0, 0}, {0, -40, 0}),
                         {.colour = {1, 0.96F, 0.9F}, .emission = light}});
  return scene;
}

Scene make_color_chart_scene() {
  Scene scene = make_empty_scene("color chart", 0.9, 0, 0, 0.25F);
  scene.textures.emplace_back(2048, 1024, [](float u, float v) -> Vector3f {
    constexpr float kPatch = 2.5F, kBetween = 0.25F, kBorder = 0.5F, kPitch = kPatch + kBetween;
    const float x = u * (rig::kChartColumns * kPitch + kBetween + 2 * kBorder) - kBorder - kBetween;
    const float y = v * (rig::kChartRows * kPitch + kBetween + 2 * kBorder) - kBorder - kBetween;
    const int column = static_cast<int>(std::floor(x / kPitch));
    const int row = static_cast<int>(std::floor(y / kPitch));
    const bool is_patch = column >= 0 && row >= 0 && column < rig::kChartColumns &&
                          row < rig::kChartRows &&
                          x - static_cast<float>(column) * kPitch < kPatch &&
                          y - static_cast<float>(row) * kPitch < kPatch;
    if (!is_patch) return Vector3f::Constant(0.02F);
    static const rig::PatchColors light = rig::color_checker_reference();
    const schemas::Rgb& patch = light[row * rig::kChartColumns + column];
    return {std::max(0.0F, static_cast<float>(patch[0])), static_cast<float>(patch[1]),
            static_cast<float>(patch[2])};
  });
  constexpr float kExposure = 0.75F;  // white stays below full scale
  constexpr float kWidth = 0.45F, kHeight = 0.3F;
  scene.parts.push_back(
      {"chart",
       make_quad({-kWidth / 2, kHeight / 2, -0.9F}, {kWidth, 0, 0}, {0, -kHeight, 0}),
       {.texture = 0, .colour = {1, 1, 1}, .emission = kExposure}});
  return scene;
}

Scene make_checkerboard_scene() {
  // Moves near enough to fill a third of the picture, with tilts to every side.
  return make_board_scene([](double seconds) {
    Isometry3f placement = Isometry3f::Identity();
    placement.translation() =
        Vector3f(0.2F * static_cast<float>(std::sin(1.1 * seconds)),
                 0.12F * static_cast<float>(std::sin(1.7 * seconds + 1)),
                 -0.62F - 0.14F * static_cast<float>(std::sin(0.6 * seconds)));
    placement.rotate(
        Eigen::AngleAxisf(0.65F * static_cast<float>(std::sin(0.9 * seconds + 0.3)),
                          Vector3f::UnitY()) *
        Eigen::AngleAxisf(0.6F * static_cast<float>(std::sin(1.3 * seconds + 2)),
                          Vector3f::UnitX()) *
        Eigen::AngleAxisf(0.3F * static_cast<float>(std::sin(0.5 * seconds)), Vector3f::UnitZ()));
    return placement;
  });
}

}  // namespace raystage::simulate
