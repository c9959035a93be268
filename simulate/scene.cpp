// SPDX-License-Identifier: Apache-2.0
#include "simulate/scene.h"

#include "base/error.h"
#include "simulate/procedural_textures.h"

namespace raystage::simulate {

std::vector<SceneName> scene_names() {
  return {{"stage", "a small stage set in motion: backdrop, lamps on wires, wheel, balls, mirror"},
          {"still", "the same set, nothing moves"},
          {"chart", "a flat chart 4 m away behind four small balls, nothing moves"},
          {"blue_screen", "a figure with loose hair that turns before a blue screen"},
          {"green_screen", "the same before a green one"},
          {"empty_blue_screen", "the blue screen alone"},
          {"moving_light", "a small light carried about in the dark, to calibrate geometry"},
          {"white", "a white target that fills every picture, to calibrate colour"},
          {"grey", "the same, a quarter as bright"},
          {"black", "lens caps"},
          {"color_chart", "a chart of 24 colours (ColorChecker), to calibrate colour"},
          {"board", "a checkerboard of 10x7 squares of 30 mm carried about, to calibrate lenses"},
          {"moving_light_around", "a small light carried around the array, for wide fisheyes"},
          {"board_around", "the checkerboard carried around the array, for wide fisheyes"}};
}

Scene make_scene(std::string_view name) {
  if (name == "stage" || name == "still") return make_stage_scene(name == "stage");
  if (name == "chart") return make_chart_scene();
  const Eigen::Vector3f blue(0.03F, 0.09F, 0.62F), green(0.06F, 0.58F, 0.08F);
  if (name == "blue_screen") return make_screen_scene(blue, true);
  if (name == "green_screen") return make_screen_scene(green, true);
  if (name == "empty_blue_screen") return make_screen_scene(blue, false);
  if (name == "white") return make_flat_field_scene(0.6F);
  if (name == "grey") return make_flat_field_scene(0.15F);
  if (name == "black") return make_flat_field_scene(0);
  if (name == "color_chart") return make_color_chart_scene();
  if (name == "board") return make_checkerboard_scene();
  if (name == "moving_light") return make_moving_light_scene();
  if (name == "moving_light_around") return make_surrounding_light_scene();
  if (name == "board_around") return make_surrounding_checkerboard_scene();
  std::string known;
  for (const SceneName& scene : scene_names()) {
    known += (known.empty() ? "" : ", ") + std::string(scene.name);
  }
  throw Error::bad_input("there is no scene \"" + std::string(name) + "\"", "scene",
                         "Choose one of: " + known);
}

Scene make_chart_scene() {
  using Eigen::Vector3f;
  Scene scene;
  scene.name = "chart";
  scene.focus = 4;
  scene.textures.emplace_back(512, 512, paint_chart);
  scene.parts.push_back({"chart",
                         make_quad({-4, 3, -4}, {8, 0, 0}, {0, -6, 0}, {4, 3}, 8),
                         {.texture = 0, .colour = {1, 1, 1}}});
  const Vector3f centres[] = {
      {-0.5F, 0.3F, -2}, {0.6F, 0.4F, -2.5F}, {-0.7F, -0.4F, -3}, {0.4F, -0.3F, -2.2F}};
  int number = 0;
  for (const Vector3f& centre : centres) {
    Eigen::Isometry3f placement = Eigen::Isometry3f::Identity();
    placement.translation() = centre;
    SceneMesh ball;
    ball.add(make_sphere(0.06F, 48), placement);
    SceneMaterial material;
    material.colour = {0.9F, 0.2F * static_cast<float>(number), 0.1F};
    scene.parts.push_back({"ball" + std::to_string(number++), std::move(ball), material});
  }
  return scene;
}

}  // namespace raystage::simulate
