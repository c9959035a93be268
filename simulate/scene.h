// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "simulate/mesh.h"
#include "simulate/texture.h"

namespace raystage::simulate {

/// The reflection model of a surface, in linear light with Rec.709 primaries.
struct SceneMaterial {
  int texture = -1;  ///< index into Scene::textures; -1: none
  Eigen::Vector3f colour = Eigen::Vector3f(0.8F, 0.8F, 0.8F);  ///< multiplied by the texture
  float specular = 0;    ///< strength of the highlight, 0 to 1
  float emission = 0;    ///< emitted light, multiplied by `colour`
  bool mirror = false;   ///< reflects once, multiplied by `colour`
  bool is_lamp = false;  ///< SimulationOptions::hdr raises its emission above white
};

/// Returns the world_from_part transform at a time in seconds since the take's epoch.
using Motion = std::function<Eigen::Isometry3f(double seconds)>;

struct ScenePart {
  std::string name;
  SceneMesh mesh;
  SceneMaterial material;
  int motion = -1;  ///< index into Scene::motions; -1: static, in world coordinates
};

/// A scene with its static and moving parts and its light. World: metres, y up; the array is at the
/// origin and looks along -z. A point light without falloff casts hard shadows. Light of sky and
/// ground is added without shadows.
struct Scene {
  std::string name;
  double focus = 5;  ///< focal plane of the shot, metres in front of the array
  std::vector<Texture> textures;
  std::vector<Motion> motions;
  std::vector<ScenePart> parts;
  Eigen::Vector3f light_position = Eigen::Vector3f(-2.5F, 4, 1);
  Eigen::Vector3f light_colour = Eigen::Vector3f(1, 0.94F, 0.84F);
  Eigen::Vector3f sky_colour = Eigen::Vector3f(0.34F, 0.37F, 0.44F);
  Eigen::Vector3f ground_colour = Eigen::Vector3f(0.20F, 0.17F, 0.14F);
  Eigen::Vector3f background = Eigen::Vector3f(0.02F, 0.02F, 0.03F);  ///< of rays without a hit
  float max_light = 1;  ///< at which the light of each sample is clipped
};

/// A name that make_scene() accepts, and a summary of its scene.
struct SceneName {
  std::string_view name, summary;
};
std::vector<SceneName> scene_names();

/// Returns the scene of this name. Throws Error (bad input) that lists the names if there is none.
Scene make_scene(std::string_view name);

Scene make_stage_scene(bool moving);
Scene make_chart_scene();
/// Returns a uniform, slightly warm target that fills every picture. `light` = 0: lens caps.
Scene make_flat_field_scene(float light);
/// Returns an evenly lit, static ColorChecker of 0.45 x 0.3 m at a distance of 0.9 m.
Scene make_color_chart_scene();
/// Returns a moving checkerboard of the squares (m) below; its top left square is black.
Scene make_checkerboard_scene();
inline constexpr int kSimulatedBoardColumns = 10, kSimulatedBoardRows = 7;
inline constexpr float kSimulatedSquareSize = 0.03F;
/// Returns a small light that moves in the dark; the name of its part is "light".
Scene make_moving_light_scene();
/// Returns the same light and board on paths around the array, up to 115 degrees from its axis.
Scene make_surrounding_light_scene();
Scene make_surrounding_checkerboard_scene();
/// Returns a coloured screen; the name of its part is "screen".
Scene make_screen_scene(const Eigen::Vector3f& screen_colour, bool with_figure);

}  // namespace raystage::simulate
