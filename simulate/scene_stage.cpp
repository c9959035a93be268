// SPDX-License-Identifier: Apache-2.0
// The built-in stage, 2 m to 8 m in front of the array. Its parts are difficult to reconstruct:
// thin wires and spokes, a fence, a mirror, folds that occlude each other, motion.
#include <cmath>

#include "simulate/procedural_textures.h"
#include "simulate/scene.h"

namespace raystage::simulate {
namespace {

using Eigen::AngleAxisf;
using Eigen::Isometry3f;
using Eigen::Vector3f;

constexpr float kFloor = -1.25F;
constexpr float kCeiling = 5;
constexpr float kBack = -7.5F;

enum TextureIndex {
  kBackdrop,
  kBoards,
  kVelvet,
  kWallpaper,
  kPoster,
  kBeachBall,
  kDots,
  kMarble,
  kCrate,
  kTwist
};

Isometry3f at(float x, float y, float z) {
  Isometry3f placement = Isometry3f::Identity();
  placement.translation() = Vector3f(x, y, z);
  return placement;
}

Isometry3f turned(const Isometry3f& placement, float angle, const Vector3f& axis) {
  Isometry3f result = placement;
  result.rotate(AngleAxisf(angle, axis));
  return result;
}

SceneMesh placed(const SceneMesh& mesh, const Isometry3f& placement) {
  SceneMesh result;
  result.add(mesh, placement);
  return result;
}

SceneMesh box_at(float x, float y, float z, float width, float height, float depth) {
  return placed(make_box({width, height, depth}), at(x, y, z));
}

class StageBuilder {
 public:
  explicit StageBuilder(bool moving) : moving_(moving) { scene_.name = moving ? "stage" : "still"; }

  Scene build() {
    const auto texture = [&](int width, int height, const ProceduralTexture& painter) {
      scene_.textures.emplace_back(width, height, painter);
    };
    texture(1024, 512, paint_backdrop);
    texture(512, 512, paint_floor);
    texture(256, 256, paint_velvet);
    texture(256, 256, paint_wallpaper);
    texture(512, 512, paint_poster);
    texture(512, 256, paint_beach_ball);
    texture(512, 256, paint_dotted_ball);
    texture(512, 256, paint_marble);
    texture(256, 256, paint_crate);
    texture(512, 256, paint_twist);
    add_room();
    add_set();
    add_mirror();
    add_movers();
    return std::move(scene_);
  }

 private:
  void still(const char* name, SceneMesh mesh, const SceneMaterial& material) {
    scene_.parts.push_back({name, std::move(mesh), material});
  }
  int motion(Motion world_from_part) {
    // The static set is the moving one at 1.7 s.
    if (!moving_) world_from_part = [world_from_part](double) { return world_from_part(1.7); };
    scene_.motions.push_back(std::move(world_from_part));
    return static_cast<int>(scene_.motions.size()) - 1;
  }
  void moving(const char* name, SceneMesh mesh, const SceneMaterial& material, int motion_index) {
    if (moving_) {
      scene_.parts.push_back({name, std::move(mesh), material, motion_index});
    } else {
      still(name, placed(mesh, scene_.motions[motion_index](0)), material);
    }
  }
  void moving(const char* name, SceneMesh mesh, const SceneMaterial& material,
              Motion world_from_part) {
    moving(name, std::move(mesh), material, motion(std::move(world_from_part)));
  }

  void add_room() {
    constexpr float kSide = 6, kFront = 3;
    const float depth = kFront - kBack, height = kCeiling - kFloor;
    still("floor",
          make_quad({-kSide, kFloor, kBack}, {2 * kSide, 0, 0}, {0, 0, depth}, {2 * kSide, depth},
                    12),
          {.texture = kBoards, .colour = {1, 1, 1}});
    still("backdrop",
          make_quad({-kSide, kCeiling, kBack}, {2 * kSide, 0, 0}, {0, -height, 0}, {1, 1}, 8),
          {.texture = kBackdrop, .colour = {1.15F, 1.15F, 1.15F}});
    SceneMesh walls =
        make_quad({-kSide, kCeiling, kFront}, {0, 0, -depth}, {0, -height, 0}, {depth, height}, 8);
    walls.add(
        make_quad({kSide, kCeiling, kBack}, {0, 0, depth}, {0, -height, 0}, {depth, height}, 8));
    walls.add(make_quad({kSide, kCeiling, kFront}, {-2 * kSide, 0, 0}, {0, -height, 0},
                        {2 * kSide, height}, 8));
    still("walls", std::move(walls), {.texture = kWallpaper, .colour = {1, 1, 1}});
    still("ceiling",
          make_quad({-kSide, kCeiling, kFront}, {2 * kSide, 0, 0}, {0, 0, -depth}, {12, 10}, 8),
          {.colour = {0.10F, 0.09F, 0.09F}});
  }

  void add_set() {
    const float height = kCeiling - kFloor;
    SceneMesh curtains = placed(make_curtain(2.2F, height, 0.13F, 9), at(-4.6F, kFloor, -5.3F));
    curtains.add(make_curtain(1.9F, height, 0.12F, 8), at(2.75F, kFloor, -5.9F));
    still("curtains", std::move(curtains), {.texture = kVelvet, .colour = {1, 1, 1}});

    still("pedestal", box_at(0.75F, kFloor + 0.4F, -5, 0.62F, 0.8F, 0.62F),
          {.texture = kCrate, .colour = {1, 1, 1}});
    still("poster",
          make_quad({-2.35F, 0.95F, -6.2F}, {0.95F, 0, 0.12F}, {0, -1.25F, 0}, {0.999F, 0.999F}, 2),
          {.texture = kPoster, .colour = {1, 1, 1}});
    SceneMesh easel = make_rod({-2.3F, kFloor, -6.1F}, {-1.95F, 1.15F, -6.25F}, 0.022F);
    easel.add(make_rod({-1.45F, kFloor, -6.0F}, {-1.8F, 1.15F, -6.25F}, 0.022F));
    still("easel", std::move(easel), {.colour = {0.30F, 0.17F, 0.08F}});

    // A wire fence in front of the backdrop, with bars about a pixel wide.
    SceneMesh fence;
    for (int i = 0; i <= 16; ++i) {
      const float x = -1.15F + 0.19F * static_cast<float>(i);
      fence.add(make_rod({x, kFloor, -6.8F}, {x, kFloor + 0.95F, -6.8F}, 0.011F, 6));
    }
    for (const float y : {0.18F, 0.5F, 0.85F}) {
      fence.add(make_rod({-1.2F, kFloor + y, -6.8F}, {1.95F, kFloor + y, -6.8F}, 0.011F, 6));
    }
    still("fence", std::move(fence), {.colour = {0.75F, 0.76F, 0.72F}});

    // Bunting across the stage: a string with flags.
    SceneMesh string, flags[3];
    const auto sag = [](float x) { return Vector3f(x, 1.25F + 0.07F * x * x, -4.9F + 0.12F * x); };
    for (int i = 0; i < 24; ++i) {
      const float x = -2.4F + 0.2F * static_cast<float>(i);
      string.add(make_rod(sag(x), sag(x + 0.2F), 0.006F, 5));
      if (i % 2 == 1) continue;
      SceneMesh flag;
      flag.positions = {sag(x + 0.02F), sag(x + 0.30F),
                        sag(x + 0.16F) + Vector3f(0, -0.30F, 0.03F)};
      const Vector3f normal = (flag.positions[2] - flag.positions[0])
                                  .cross(flag.positions[1] - flag.positions[0])
                                  .normalized();
      flag.normals.assign(3, normal);
      flag.uvs = {{0, 0}, {1, 0}, {0.5F, 1}};
      flag.triangles = {{0, 2, 1}};
      flags[(i / 2) % 3].add(flag);
    }
    still("string", std::move(string), {.colour = {0.85F, 0.82F, 0.75F}});
    still("flags red", std::move(flags[0]), {.texture = kVelvet, .colour = {1.4F, 1.4F, 1.4F}});
    still("flags green", std::move(flags[1]), {.texture = kMarble, .colour = {1, 1, 1}});
    still("flags twist", std::move(flags[2]), {.texture = kTwist, .colour = {1, 1, 1}});

    SceneMesh stand = make_rod({-1.42F, kFloor, -4.55F}, {-1.35F, -0.62F, -4.42F}, 0.016F);
    stand.add(make_rod({-1.28F, kFloor, -4.55F}, {-1.35F, -0.62F, -4.42F}, 0.016F));
    still("wheel stand", std::move(stand), {.colour = {0.10F, 0.10F, 0.11F}, .specular = 0.3F});
  }

  void add_mirror() {
    // Rotated towards the stage, so that it shows the balls and the far curtain.
    const Isometry3f placement = turned(at(2.05F, -0.12F, -5.0F), -0.50F, Vector3f::UnitY());
    constexpr float kWidth = 1.15F, kHeight = 1.9F;
    SceneMesh glass = placed(
        make_quad({-kWidth / 2, kHeight / 2, 0}, {kWidth, 0, 0}, {0, -kHeight, 0}), placement);
    still("mirror", std::move(glass), {.colour = {0.86F, 0.88F, 0.87F}, .mirror = true});
    SceneMesh frame;
    for (const float side : {-1.0F, 1.0F}) {
      frame.add(placed(box_at(side * (kWidth / 2 + 0.03F), 0, 0, 0.06F, kHeight + 0.12F, 0.07F),
                       placement));
      frame.add(
          placed(box_at(0, side * (kHeight / 2 + 0.03F), 0, kWidth, 0.06F, 0.07F), placement));
      frame.add(make_rod(placement * Vector3f(side * 0.45F, -0.95F, -0.02F),
                         placement * Vector3f(side * 0.5F, kFloor + 0.12F, -0.4F), 0.025F));
    }
    still("mirror frame", std::move(frame), {.colour = {0.62F, 0.42F, 0.12F}, .specular = 0.4F});
  }

  void add_lamp(const char* name, float x, float z, float y, float phase) {
    const float length = kCeiling - y;
    const int swing = motion([=](double seconds) {
      const float angle = 0.035F * std::sin(1.9F * static_cast<float>(seconds) + phase);
      return turned(at(x, kCeiling, z), angle, Vector3f(0.6F, 0, 0.8F));
    });
    moving(name, make_rod({0, 0, 0}, {0, -length + 0.2F, 0}, 0.009F, 6),
           {.colour = {0.02F, 0.02F, 0.02F}}, swing);
    moving("lamp shade", placed(make_cone(0.035F, 0.16F, 0.17F, 32), at(0, -length + 0.04F, 0)),
           {.colour = {0.05F, 0.22F, 0.16F}, .specular = 0.5F}, swing);
    moving("lamp bulb", placed(make_sphere(0.055F, 24), at(0, -length + 0.03F, 0)),
           {.colour = {1, 0.86F, 0.55F}, .emission = 1, .is_lamp = true}, swing);
  }

  void add_movers() {
    add_lamp("lamp wire left", -0.95F, -3.1F, 0.62F, 0);
    add_lamp("lamp wire middle", 0.42F, -4.3F, 0.80F, 2);
    add_lamp("lamp wire right", 1.45F, -3.6F, 0.55F, 4);

    moving("beach ball", make_sphere(0.29F, 48),
           {.texture = kBeachBall, .colour = {1, 1, 1}, .specular = 0.25F}, [](double seconds) {
             const auto t = static_cast<float>(seconds);
             const float height = std::abs(std::sin(2.1F * t + 0.4F));
             const float x = -0.35F + 0.42F * std::sin(0.8F * t);
             return turned(turned(at(x, kFloor + 0.29F + 0.75F * height, -3.55F), -1.3F * t,
                                  {0.2F, 0.1F, 0.97F}),
                           0.6F, Vector3f::UnitX());
           });
    moving("rolling ball", make_sphere(0.33F, 48),
           {.texture = kDots, .colour = {1, 1, 1}, .specular = 0.35F}, [](double seconds) {
             const float x = 0.25F + 1.25F * std::sin(0.55F * static_cast<float>(seconds) - 0.8F);
             return turned(turned(at(x, kFloor + 0.33F, -4.35F), -x / 0.33F, Vector3f::UnitZ()),
                           1.2F, Vector3f::UnitX());
           });
    const int pendulum = motion([](double seconds) {
      const float angle = 0.105F * std::sin(1.45F * static_cast<float>(seconds) + 0.5F);
      return turned(at(0.78F, kCeiling, -2.45F), angle, Vector3f::UnitZ());
    });
    moving("pendulum wire", make_rod({0, 0, 0}, {0, -5.3F, 0}, 0.0065F, 6),
           {.colour = {0.8F, 0.76F, 0.66F}}, pendulum);
    moving("pendulum", placed(make_sphere(0.13F, 48), at(0, -5.42F, 0)),
           {.texture = kMarble, .colour = {1, 1, 1}, .specular = 0.5F}, pendulum);
    moving("ring", make_torus(0.30F, 0.10F, 64, 24),
           {.texture = kTwist, .colour = {1, 1, 1}, .specular = 0.3F}, [](double seconds) {
             const auto t = static_cast<float>(seconds);
             const float lift = 0.03F * std::sin(1.7F * t);
             return turned(
                 turned(at(0.75F, kFloor + 1.27F + lift, -5), 0.9F * t, Vector3f::UnitY()),
                 0.5F * t, Vector3f::UnitX());
           });
    moving("wheel", make_wheel(0.46F, 0.006F, 24),
           {.colour = {0.70F, 0.71F, 0.74F}, .specular = 0.4F}, [](double seconds) {
             return turned(turned(at(-1.35F, -0.62F, -4.38F), 0.25F, Vector3f::UnitY()),
                           -0.8F * static_cast<float>(seconds), Vector3f::UnitZ());
           });
    moving("crate", make_box({0.62F, 0.62F, 0.62F}),
           {.texture = kCrate, .colour = {1.2F, 1.15F, 1.1F}}, [](double seconds) {
             return turned(at(-2.35F, kFloor + 0.312F, -5.15F),
                           0.5F + 0.35F * static_cast<float>(seconds), Vector3f::UnitY());
           });
  }

  bool moving_;
  Scene scene_;
};

}  // namespace

Scene make_stage_scene(bool moving) { return StageBuilder(moving).build(); }

}  // namespace raystage::simulate
