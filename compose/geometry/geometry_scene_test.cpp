// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/geometry_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <tbb/global_control.h>

#include <Eigen/LU>

#include "testing/compose/test_meshes.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using testing::ball;
using testing::make_instance;
using testing::make_material;
using testing::square;
using Kind = Material::Kind;

render::VirtualCamera looking_from(const Vector3d& position, int width = 64, int height = 48,
                                   double fov = 0.9) {
  rig::Pose pose;
  pose.position = position;
  return render::virtual_camera_with_fov(width, height, fov, pose);
}

EnvironmentRadiance all_the_same(float radiance) {
  return [radiance](std::span<const render::WorldRay>, std::span<const float>,
                    std::span<Vector3f> seen) {
    std::ranges::fill(seen, Vector3f::Constant(radiance));
  };
}

std::array<float, 4> pixel_of(const LayerImage& image, int x, int y) {
  const std::size_t at = 4 * static_cast<std::size_t>(y * image.width + x);
  return {image.rgba[at], image.rgba[at + 1], image.rgba[at + 2], image.rgba[at + 3]};
}

Vector3d aov_of(const LayerImage& image, std::size_t aov, int x, int y) {
  const std::size_t at = 3 * static_cast<std::size_t>(y * image.width + x);
  const auto& values = image.aovs[aov].values;
  return Vector3f(values[at], values[at + 1], values[at + 2]).cast<double>();
}

TEST(GeometryView, ASquareIsWhereItIs) {
  const EmbreeMesh scene(square(1, make_material(Kind::kDiffuse, 0.5F)), "square");
  GeometryScene geometry{{make_instance(scene, {0, 0, -4})}, nullptr, {}};
  geometry.lights.ambient = {1, 2, 4};
  const render::VirtualCamera camera = looking_from({0, 0, 0});
  const LayerImage image = render_geometry(geometry, 0, camera, 64);
  const double half = camera.intrinsics.fx / 4;  // pixels
  double covered = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const auto inside = [&](double at, double centre) {
        return std::clamp(half + 0.5 - std::abs(at + 0.5 - centre), 0.0, 1.0);
      };
      const double alpha = inside(x, camera.intrinsics.cx) * inside(y, camera.intrinsics.cy);
      const auto rgba = pixel_of(image, x, y);
      ASSERT_NEAR(rgba[3], alpha, 0.07) << x << " " << y;  // of 8x8 samples
      ASSERT_NEAR(rgba[0], 0.5F * rgba[3], 1e-6);
      ASSERT_NEAR(rgba[2], 2 * rgba[3], 1e-6);
      covered += double{rgba[3]};
      const std::size_t at = static_cast<std::size_t>(y * camera.width + x);
      if (rgba[3] == 0) {
        ASSERT_EQ(image.z[at], std::numeric_limits<float>::infinity());
        continue;
      }
      ASSERT_NEAR(image.z[at], 4, 1e-5);
      ASSERT_NEAR(aov_of(image, 0, x, y).z(), -4, 1e-5);
      ASSERT_TRUE(aov_of(image, 1, x, y).isApprox(Vector3d::UnitZ(), 1e-6));
      ASSERT_TRUE(aov_of(image, 2, x, y).isApprox(Vector3d::Constant(0.5), 1e-6));
    }
  }
  EXPECT_NEAR(covered, 4 * half * half, 0.01 * covered);
}

/// Compares with brute-force intersection of all triangles in double.
TEST(GeometryView, MeetsTheNearestTriangle) {
  rc::check("as Moeller and Trumbore say", [] {
    const auto number = [](double most) {
      return *rc::gen::map(rc::gen::inRange(-100000, 100001),
                           [most](int i) { return i * most / 100000; });
    };
    Mesh mesh;
    const int triangles = *rc::gen::inRange(1, 12);
    for (int i = 0; i < 3 * triangles; ++i) {
      mesh.positions.emplace_back(number(1), number(1), number(1));
    }
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(triangles); ++i) {
      mesh.corners.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    mesh.triangle_objects.assign(mesh.corners.size(), 0);
    mesh.objects = {{"soup", 0}};
    mesh.materials = {make_material(Kind::kDiffuse)};
    const EmbreeMesh scene(mesh, "soup");
    const double scale = std::pow(10, number(3)), far = std::pow(10, 3 + number(3));
    const Vector3d at(number(1e7), number(1e7), number(1e7));
    const MeshInstance placed = make_instance(scene, at, scale);
    std::vector<render::WorldRay> rays;
    for (int i = 0; i < 33; ++i) {
      const Vector3d through = at + scale * Vector3d(number(1), number(1), number(1));
      const Vector3d from =
          at + far * scale * Vector3d(number(1), number(1), number(1) + 1.5).normalized();
      rays.push_back({from, (through - from).normalized()});
    }
    std::vector<SurfaceHit> hits(rays.size());
    scene.intersect(placed.object_from_world, rays, 0, hits);
    for (std::size_t r = 0; r < rays.size(); ++r) {
      const Vector3d origin = (rays[r].origin - at) / scale;
      double nearest = SurfaceHit::kNone, margin = 1;
      for (const auto& c : mesh.corners) {
        Eigen::Matrix3d m;
        m << mesh.positions[c[1]] - mesh.positions[c[0]],
            mesh.positions[c[2]] - mesh.positions[c[0]], -rays[r].direction;
        const Vector3d uvt = m.fullPivLu().solve(origin - mesh.positions[c[0]]);
        const double inside = std::min({uvt.x(), uvt.y(), 1 - uvt.x() - uvt.y()});
        const double slant = std::abs(m.determinant());
        if (slant < 1e-3) margin = 0;  // nearly edge-on: depends on rounding
        margin = std::min(margin, std::abs(inside));
        if (inside >= 0 && uvt.z() > 0) nearest = std::min(nearest, uvt.z());
      }
      if (margin < 2e-2) continue;
      RC_ASSERT(std::isfinite(nearest) == hits[r].is_hit());
      // World coordinates of 1e7 m are exact to 2e-9 m.
      if (hits[r].is_hit()) {
        RC_ASSERT(std::abs(hits[r].distance / scale - nearest) < 2e-4 + 1e-7 / scale);
      }
    }
  });
}

TEST(GeometryView, ABallIsLitByTheCosineAndItsNormals) {
  const EmbreeMesh scene(ball(1, make_material(Kind::kDiffuse)), "ball");
  GeometryScene geometry{{make_instance(scene, {0, 0, -4})}, nullptr, {}};
  const Vector3d towards = Vector3d(1, 2, 3).normalized();
  geometry.lights.direct = {{towards, {1, 1, 1}, true}};
  const LayerImage image = render_geometry(geometry, 0, looking_from({0, 0, 0}), 1);
  int seen = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (pixel_of(image, x, y)[3] == 0) continue;
      const Vector3d normal = (aov_of(image, 0, x, y) - Vector3d(0, 0, -4)).normalized();
      const double cosine = std::max(normal.dot(towards), 0.0);
      if (cosine < 0.1) continue;  // faces and normals may disagree about the light's side
      ++seen;
      EXPECT_NEAR(pixel_of(image, x, y)[0], cosine, 0.01) << x << " " << y;
      EXPECT_GT(aov_of(image, 1, x, y).dot(normal), 1 - 1e-4);
    }
  }
  EXPECT_GT(seen, 300);
}

TEST(GeometryView, OthersThrowShadowsButAreNotSeen) {
  const EmbreeMesh floor(square(4, make_material(Kind::kDiffuse)), "floor");
  const EmbreeMesh roof(square(1, make_material(Kind::kDiffuse)), "roof");
  GeometryScene geometry{
      {make_instance(floor, {0, 0, -6}), make_instance(roof, {0, 0, -5})}, nullptr, {}};
  geometry.lights.direct = {{Vector3d(0.6, 0, 0.8), {1, 1, 1}, true}};
  const render::VirtualCamera camera = looking_from({0, 0, 0}, 128, 96);
  const LayerImage image = render_geometry(geometry, 0, camera, 1);
  // Light from the right: the shadow is 0.6 / 0.8 metres to the left.
  for (int x = 0; x < camera.width; ++x) {
    const double on_floor = (x + 0.5 - camera.intrinsics.cx) / camera.intrinsics.fx * 6;
    const double from_edge = std::min(on_floor + 1.75, 0.25 - on_floor);
    if (std::abs(from_edge) < 0.1) continue;
    EXPECT_NEAR(pixel_of(image, x, 48)[0], from_edge > 0 ? 0 : 0.8, 1e-5) << x;
  }
  geometry.lights.direct[0].casts_shadows = false;
  EXPECT_NEAR(pixel_of(render_geometry(geometry, 0, camera, 1), 50, 48)[0], 0.8, 1e-5);
}

/// A card of 1 cm stands on a square of 1 km, whose coordinates are float in Embree.
TEST(GeometryView, WhatTouchesAHugeSurfaceThrowsItsShadowThere) {
  constexpr double kCardHeight = 0.01;  // metres
  const EmbreeMesh ground(square(500, make_material(Kind::kDiffuse)), "ground");
  Mesh upright = square(kCardHeight / 2, make_material(Kind::kDiffuse));
  for (Vector3d& p : upright.positions) p = {0, p.y(), p.x() + kCardHeight / 2};
  const EmbreeMesh card(upright, "card");
  const Vector3d place(230, -110, 0);
  GeometryScene geometry{{make_instance(ground, {0, 0, 0}), make_instance(card, place)}, {}, {}};
  geometry.lights.direct = {{Vector3d(1, 0, 1).normalized(), {1, 1, 1}, true}};
  const render::VirtualCamera camera = looking_from(place + Vector3d(0, 0, 0.1), 256, 8);
  const LayerImage image = render_geometry(geometry, 0, camera, 1);
  int shaded = 0;
  for (int x = 0; x < camera.width; ++x) {
    const double on_ground = (x + 0.5 - camera.intrinsics.cx) / camera.intrinsics.fx * 0.1;
    const double from_edge = std::min(on_ground + kCardHeight, -on_ground);
    if (std::abs(from_edge) < 1e-3) continue;
    shaded += from_edge > 0 ? 1 : 0;
    EXPECT_NEAR(pixel_of(image, x, 4)[0], from_edge > 0 ? 0 : std::sqrt(0.5), 1e-5) << on_ground;
  }
  EXPECT_GT(shaded, 15);
}

TEST(GeometryView, NoSurfaceShadowsItself) {
  for (int i = 0; i < 24; ++i) {
    Mesh tilted = square(500, make_material(Kind::kDiffuse));
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.04 * i, Vector3d(1, 0.3, 0).normalized()).toRotationMatrix();
    for (Vector3d& p : tilted.positions) p = turn * p;
    const EmbreeMesh ground(tilted, "ground");
    GeometryScene geometry{{make_instance(ground, {3, 5, 7})}, {}, {}};
    // The light grazes the ground.
    const double cosine = 0.002;
    const Vector3d towards(std::cos(i), std::sin(i), cosine);
    geometry.lights.direct = {{turn * towards.normalized(), {1, 1, 1}, true}};
    const render::VirtualCamera camera = looking_from({3, 5, 7 + 5.0 * (i + 1)}, 32, 24);
    const LayerImage image = render_geometry(geometry, 0, camera, 1);
    for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
      ASSERT_EQ(image.rgba[4 * pixel + 3], 1);
      ASSERT_NEAR(image.rgba[4 * pixel], cosine, 1e-6) << i << " " << pixel;
    }
  }
}

/// The penumbra of a square's edge: a share of the lamp's disc that the edge leaves.
TEST(GeometryView, ALampWithASizeCastsASoftShadow) {
  const EmbreeMesh floor(square(4, make_material(Kind::kDiffuse)), "floor");
  const EmbreeMesh roof(square(1, make_material(Kind::kDiffuse)), "roof");
  GeometryScene geometry{
      {make_instance(floor, {0, 0, -6}), make_instance(roof, {1, 0, -5})}, nullptr, {}};
  DirectLight lamp{.color = {100, 100, 100}};
  lamp.position = Vector3d(0, 0, 4);
  lamp.radius = 0.5;
  geometry.lights.direct = {lamp};
  const render::VirtualCamera camera = looking_from({0, 0, 0}, 256, 192);
  const LayerImage image = render_geometry(geometry, 0, camera, 64);
  geometry.lights.direct[0].casts_shadows = false;
  const LayerImage open = render_geometry(geometry, 0, camera, 64);
  int partly = 0;
  for (int x = 0; x < camera.width; ++x) {
    if (pixel_of(image, x, 96)[3] < 1) continue;
    const double on_floor = (x + 0.5 - camera.intrinsics.cx) / camera.intrinsics.fx * 6;
    // The roof begins at x = 0: seen from the floor the lamp's visible part ends at this place.
    const double edge = on_floor + (0 - on_floor) / 1 * 10;  // at z = 4
    const double cut = std::clamp(edge / lamp.radius, -1.0, 1.0);
    if (on_floor > 0.3 || on_floor < -0.3) continue;
    // The share of a disc left of a chord; the roof is on the right.
    const double hidden_from = cut;
    const double share =
        1 - (std::acos(hidden_from) - hidden_from * std::sqrt(1 - hidden_from * hidden_from)) /
                std::numbers::pi;
    partly += share > 0.1 && share < 0.9;
    EXPECT_NEAR(pixel_of(image, x, 96)[0] / pixel_of(open, x, 96)[0], share, 0.06) << on_floor;
  }
  EXPECT_GT(partly, 2);
  EXPECT_NEAR(pixel_of(open, 128, 96)[0], 1, 0.01) << "100 at 10 m";
}

TEST(GeometryView, AMirrorShowsWhereItsRaysGo) {
  const EmbreeMesh scene(ball(1, make_material(Kind::kMirror)), "ball");
  GeometryScene geometry{{make_instance(scene, {0.5, 0, -4})}, nullptr, {}};
  geometry.lights.environment_radiance = [](std::span<const render::WorldRay> rays,
                                            std::span<const float>, std::span<Vector3f> seen) {
    for (std::size_t i = 0; i < rays.size(); ++i) {
      seen[i] = (rays[i].direction.array() + 1).matrix().cast<float>();
    }
  };
  const render::VirtualCamera camera = looking_from({0, 0, 0});
  const LayerImage image = render_geometry(geometry, 0, camera, 1);
  int seen = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (pixel_of(image, x, y)[3] == 0) continue;
      const Vector3d at = aov_of(image, 0, x, y), normal = aov_of(image, 1, x, y);
      if (normal.dot(-at.normalized()) < 0.3) continue;
      const Vector3d d = at.normalized();
      const Vector3d expected = d - 2 * d.dot(normal) * normal;
      const auto rgba = pixel_of(image, x, y);
      ++seen;
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(rgba[c] - 1, expected(static_cast<Eigen::Index>(c)), 1e-5);
      }
    }
  }
  EXPECT_GT(seen, 300);
}

TEST(GeometryView, MirrorsShowEachOther) {
  const EmbreeMesh mirror(square(1, make_material(Kind::kMirror, 0.5F)), "mirror");
  const EmbreeMesh wall(square(9, make_material(Kind::kDiffuse, 1)), "wall");
  GeometryScene geometry{
      {make_instance(mirror, {0, 0, -4}), make_instance(wall, {0, 0, 3})}, nullptr, {}};
  geometry.lights.ambient = {0.25F, 0.5F, 1};
  geometry.lights.environment_radiance = all_the_same(100);
  const auto rgba = pixel_of(render_geometry(geometry, 0, looking_from({0, 0, 0}), 4), 32, 24);
  EXPECT_NEAR(rgba[0], 0.125, 1e-6);
  EXPECT_NEAR(rgba[2], 0.5, 1e-6);
}

/// White surfaces in a uniform environment are invisible (furnace test).
TEST(GeometryView, WhiteInAWhiteFurnaceIsWhite) {
  const render::VirtualCamera camera = looking_from({0, 0, 0}, 32, 24);
  for (const auto& [kind, least] :
       {std::pair{Kind::kDiffuse, 1.0}, {Kind::kMirror, 1.0}, {Kind::kGlossy, 0.9}}) {
    const EmbreeMesh scene(ball(1, make_material(kind)), "ball");
    GeometryScene geometry{{make_instance(scene, {0, 0, -4})}, nullptr, {}};
    geometry.lights.environment_radiance = all_the_same(1);
    geometry.lights.gather_rays = 8;
    const LayerImage image = render_geometry(geometry, 0, camera, 4);
    double sum = 0, alpha = 0;
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const auto rgba = pixel_of(image, x, y);
        EXPECT_LE(rgba[0], rgba[3] + 1e-5);
        sum += double{rgba[0]};
        alpha += double{rgba[3]};
      }
    }
    EXPECT_GT(alpha, 50);
    EXPECT_GT(sum, (least - 1e-4) * alpha) << static_cast<int>(kind);
  }
}

TEST(GeometryView, SameBytesForAnyNumberOfThreads) {
  const EmbreeMesh scene(ball(1, make_material(Kind::kGlossy)), "ball");
  const EmbreeMesh floor(square(3, make_material(Kind::kDiffuse, 0.7F)), "floor");
  GeometryScene geometry{
      {make_instance(scene, {0, 0, -4}), make_instance(floor, {0, 0, -6})}, nullptr, {}};
  geometry.lights.direct = {{Vector3d(0.6, 0, 0.8), {1, 1, 1}, true}};
  geometry.lights.ambient.setConstant(0.2F);
  geometry.lights.gather_rays = 4;
  const render::VirtualCamera camera = looking_from({0, 0, 0}, 61, 47);
  const LayerImage image = render_geometry(geometry, 1, camera, 9);
  for (const std::size_t threads : {1, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const LayerImage again = render_geometry(geometry, 1, camera, 9);
    EXPECT_EQ(again.rgba, image.rgba);
    EXPECT_EQ(again.z, image.z);
    EXPECT_EQ(again.aovs[1].values, image.aovs[1].values);
  }
}

TEST(GeometryView, FarAwayAndHugeAndTinyStaysFinite) {
  const EmbreeMesh scene(ball(1, make_material(Kind::kMirror)), "ball");
  for (const double offset : {0.0, 1e7}) {
    for (const double scale : {1e-3, 1.0, 1e4}) {
      for (const double away : {0.0, 1.0, 1.5, 100.0, 1e6}) {  // in units of the ball
        const Vector3d at(offset, -offset, offset);
        GeometryScene geometry{{make_instance(scene, at, scale)}, nullptr, {}};
        geometry.lights.environment_radiance = all_the_same(1);
        const render::VirtualCamera camera =
            looking_from(at + Vector3d(0, 0, away * scale), 16, 12, away > 10 ? 3 / away : 0.9);
        const LayerImage image = render_geometry(geometry, 0, camera, 4);
        for (const float value : image.rgba) ASSERT_TRUE(std::isfinite(value));
        const auto rgba = pixel_of(image, 8, 6);
        EXPECT_EQ(rgba[3], 1) << offset << " " << scale << " " << away;
        const double expected = away <= 1 ? 1 - away : away - 1;
        if (away == 1.0) continue;  // the camera is on the ball
        EXPECT_NEAR(double{image.z[6 * 16 + 8]} / scale, expected,
                    0.02 + 1e-6 * away + 4e-9 * offset / scale);
      }
    }
  }
}

}  // namespace
}  // namespace raystage::compose
