// SPDX-License-Identifier: Apache-2.0
// What is recorded to calibrate an array: a light carried about in the dark.
#include <cmath>

#include "ingest/simulated/scene.h"

namespace raystage {

Scene make_moving_light_scene() {
  using Eigen::Isometry3f;
  using Eigen::Vector3f;
  Scene scene;
  scene.name = "moving light";
  scene.focus = 2;
  scene.light_colour = Vector3f::Zero();
  scene.sky_colour = Vector3f::Constant(0.004F);
  scene.ground_colour = Vector3f::Constant(0.003F);
  scene.background = Vector3f::Constant(0.001F);

  // Near and far, and into the corners of every camera's picture; no rate is a multiple of another.
  scene.motions.push_back([](double seconds) {
    const double distance = 1.7 + 0.85 * std::sin(0.47 * seconds + 0.4);
    Isometry3f placement = Isometry3f::Identity();
    placement.translation() =
        Eigen::Vector3d(0.56 * distance * std::sin(1.31 * seconds),
                        0.40 * distance * std::sin(1.87 * seconds + 1), -distance)
            .cast<float>();
    return placement;
  });
  constexpr float kBulb = 0.011F;
  scene.parts.push_back(
      {"light", make_sphere(kBulb, 24), {.colour = {0.9F, 0.86F, 0.8F}, .emission = 0.9F}, 0});

  // What must not be taken for it: a window pane that mirrors it, and a lamp of some machine.
  scene.parts.push_back({"pane",
                         make_quad({1.5F, 1.2F, -1.2F}, {0, 0, -2.4F}, {0, -2.4F, 0}),
                         {.colour = {0.25F, 0.25F, 0.25F}, .mirror = true}});
  SceneMesh lamp;
  Isometry3f at = Isometry3f::Identity();
  at.translation() = Vector3f(-0.9F, -0.8F, -3.1F);
  lamp.add(make_sphere(0.009F, 16), at);
  scene.parts.push_back({"machine's lamp", lamp, {.colour = {0.1F, 0.9F, 0.2F}, .emission = 0.7F}});
  scene.parts.push_back({"wall",
                         make_quad({-4, 3, -3.6F}, {8, 0, 0}, {0, -6, 0}, {1, 1}, 4),
                         {.colour = {0.6F, 0.6F, 0.6F}}});
  return scene;
}

}  // namespace raystage
