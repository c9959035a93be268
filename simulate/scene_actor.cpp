// SPDX-License-Identifier: Apache-2.0
// A figure in front of a keying screen, with hair thinner than a pixel, moving hands and striped
// cloth. The screen is darker towards its borders, as real ones are.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "simulate/hash_random.h"
#include "simulate/procedural_textures.h"
#include "simulate/scene.h"

namespace raystage::simulate {
namespace {

using Eigen::Isometry3f;
using Eigen::Vector3f;

constexpr float kFigureZ = -3.4F;
constexpr float kScreenZ = -6;

Isometry3f moved(float x, float y, float z) {
  Isometry3f placement = Isometry3f::Identity();
  placement.translation() = Vector3f(x, y, z);
  return placement;
}

/// Returns hair around the centre of a head: curved strands that leave the face free.
SceneMesh make_hair(float head_radius) {
  constexpr int kStrands = 90;
  constexpr float kRadius = 0.0022F;
  SceneMesh hair;
  for (int i = 0; i < kStrands; ++i) {
    HashRandom random{71, static_cast<std::uint64_t>(i)};
    const auto between = [&](double low, double high) {
      return static_cast<float>(random.uniform(low, high));
    };
    const float around = between(0, 2 * std::numbers::pi);
    const float up = between(-0.2, 1);
    Vector3f away(std::cos(around) * std::sqrt(std::max(0.0F, 1 - up * up)), up,
                  std::sin(around) * std::sqrt(std::max(0.0F, 1 - up * up)));
    if (away.z() > 0.4F && away.y() < 0.6F) away.z() = -away.z();
    Vector3f from = 0.98F * head_radius * away;
    Vector3f step = 0.05F * away;
    for (int piece = 0; piece < 5; ++piece) {
      step += Vector3f(between(-0.004, 0.004), -0.012F, between(-0.004, 0.004));
      hair.add(make_rod(from, from + step, kRadius, 5));
      from += step;
    }
  }
  return hair;
}

void add_figure(Scene& scene) {
  scene.textures.emplace_back(256, 256, paint_velvet);
  scene.textures.emplace_back(512, 256, paint_beach_ball);
  const int cloth = static_cast<int>(scene.textures.size()) - 2, stripes = cloth + 1;
  scene.motions.push_back([](double seconds) {
    Isometry3f placement = moved(0, -0.1F, kFigureZ);
    placement.rotate(
        Eigen::AngleAxisf(0.5F * std::sin(1.1F * static_cast<float>(seconds)), Vector3f::UnitY()));
    return placement;
  });
  const auto part = [&](const char* name, const SceneMesh& mesh, const Isometry3f& placement,
                        const SceneMaterial& material) {
    SceneMesh of_figure;
    of_figure.add(mesh, placement);
    scene.parts.push_back({name, std::move(of_figure), material, 0});
  };
  constexpr float kHead = 0.2F;
  const Isometry3f head = moved(0, 0.62F, 0);
  part("head", make_sphere(kHead, 48), head, {.colour = {0.72F, 0.48F, 0.36F}, .specular = 0.1F});
  part("hair", make_hair(kHead), head, {.colour = {0.20F, 0.11F, 0.05F}, .specular = 0.2F});
  part("trunk", make_torus(0.17F, 0.16F, 48, 24), moved(0, 0.1F, 0),
       {.texture = cloth, .colour = {1, 1, 1}});
  part("hips", make_sphere(0.26F, 48), moved(0, -0.35F, 0),
       {.texture = stripes, .colour = {1, 0.9F, 0.5F}});
  for (const float side : {-1.0F, 1.0F}) {
    const Vector3f shoulder(side * 0.3F, 0.2F, 0), hand(side * 0.85F, 0.35F, 0.25F);
    part("arm", make_rod(shoulder, hand, 0.05F, 16), moved(0, 0, 0),
         {.colour = {0.72F, 0.48F, 0.36F}});
    SceneMesh fingers;
    for (int i = 0; i < 4; ++i) {
      const float spread = 0.035F * (static_cast<float>(i) - 1.5F);
      fingers.add(make_rod(hand, hand + Vector3f(side * 0.12F, 0.05F + spread, spread), 0.011F));
    }
    part("fingers", fingers, moved(0, 0, 0), {.colour = {0.75F, 0.5F, 0.38F}});
    part("leg", make_rod({side * 0.13F, -0.5F, 0}, {side * 0.2F, -1.3F, 0}, 0.08F, 16),
         moved(0, 0, 0), {.colour = {0.35F, 0.33F, 0.30F}});
  }
}

}  // namespace

Scene make_screen_scene(const Vector3f& screen_colour, bool with_figure) {
  Scene scene;
  scene.name = "screen";
  scene.focus = -kFigureZ;
  // High, so that the figure's shadow is below the array's field of view.
  scene.light_position = Vector3f(-2.5F, 11, 1);
  scene.light_colour = Vector3f(1.3F, 1.22F, 1.1F);
  scene.sky_colour = Vector3f(0.55F, 0.56F, 0.6F);
  scene.ground_colour = Vector3f(0.40F, 0.37F, 0.34F);
  scene.textures.emplace_back(256, 256, [](float u, float v) {
    const float x = 2 * u - 1, y = 2 * v - 1;
    return Vector3f(Vector3f::Constant(1 - 0.35F * x * x - 0.25F * y * y + 0.08F * x));
  });
  scene.parts.push_back({"screen",
                         make_quad({-8, 7, kScreenZ}, {16, 0, 0}, {0, -14, 0}, {0.999F, 0.999F}, 8),
                         {.texture = 0, .colour = screen_colour}});
  if (with_figure) add_figure(scene);
  return scene;
}

}  // namespace raystage::simulate
