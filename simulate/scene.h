// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "simulate/mesh.h"
#include "simulate/texture.h"

namespace raystage {

/// How a surface answers light. Linear light, Rec.709 primaries.
struct SceneMaterial {
  int texture = -1;  ///< in Scene::textures; -1: colour alone
  Eigen::Vector3f colour = Eigen::Vector3f(0.8F, 0.8F, 0.8F);  ///< times the texture
  float specular = 0;   ///< strength of the highlight, 0 to 1
  float emission = 0;   ///< light given off, times `colour`
  bool mirror = false;  ///< reflects `colour` times what it sees, once
};

/// World placement of a part at a time, seconds since the take's epoch.
using Motion = std::function<Eigen::Isometry3f(double seconds)>;

struct ScenePart {
  std::string name;
  SceneMesh mesh;
  SceneMaterial material;
  int motion = -1;  ///< in Scene::motions; -1: stands in world coordinates and never moves
};

/// A stage set: what stands and moves in it, and its light. World: metres, y up; the array looks
/// down -z from the origin. Light comes from a point with a hard shadow, does not fall off, and is
/// filled up by a sky and a ground without shadow.
struct Scene {
  std::string name;
  double focus = 5;  ///< where the virtual camera's shot is sharp, metres in front of the array
  std::vector<Texture> textures;
  std::vector<Motion> motions;
  std::vector<ScenePart> parts;
  Eigen::Vector3f light_position = Eigen::Vector3f(-2.5F, 4, 1);
  Eigen::Vector3f light_colour = Eigen::Vector3f(1, 0.94F, 0.84F);
  Eigen::Vector3f sky_colour = Eigen::Vector3f(0.34F, 0.37F, 0.44F);
  Eigen::Vector3f ground_colour = Eigen::Vector3f(0.20F, 0.17F, 0.14F);
  Eigen::Vector3f background = Eigen::Vector3f(0.02F, 0.02F, 0.03F);  ///< where nothing stands
};

/// Names that make_scene() knows, and what they are.
struct SceneName {
  std::string_view name, summary;
};
std::vector<SceneName> scene_names();

/// Throws Error (bad input) naming the scenes there are.
Scene make_scene(std::string_view name);

Scene make_stage_scene(bool moving);
Scene make_chart_scene();
/// A target that fills every picture and is everywhere as bright, a little warm; 0: lens caps.
Scene make_flat_field_scene(float light);
/// A ColorChecker of 0.45 x 0.3 m, as bright everywhere, held still at 0.9 m.
Scene make_color_chart_scene();
/// A checkerboard, black squares first, that is carried about: so many squares, metres each.
Scene make_checkerboard_scene();
inline constexpr int kSimulatedBoardColumns = 10, kSimulatedBoardRows = 7;
inline constexpr float kSimulatedSquareSize = 0.03F;
/// The light's part is called "light".
Scene make_moving_light_scene();
/// The screen's part is called "screen".
Scene make_screen_scene(const Eigen::Vector3f& screen_colour, bool with_figure);

}  // namespace raystage
