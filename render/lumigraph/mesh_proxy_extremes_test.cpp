// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <array>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <limits>

#include "render/common/plane_surface.h"
#include "render/lumigraph/mesh_proxy.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"
#include "testing/render/worst_error.h"
#include "testing/test_folder.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::between;
using testing::direction;
using testing::exact;
using testing::exact_plane_distance;
using testing::ExactVector;
using testing::off;
using testing::random_origin;
using testing::Real;
using testing::WorstError;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

double meet(const RaySurface& surface, const WorldRay& ray) {
  double inverse_distance = -1;
  surface({&ray, 1}, {&inverse_distance, 1});
  return inverse_distance;
}

TEST(ProxyExtremes, APlaneIsMetWhere50DigitsMeetIt) {
  WorstError relative("plane: inverse distance, relative", 1e-12);
  EXPECT_TRUE(rc::check("any ray and plane", [&] {
    const WorldRay ray{random_origin() + 3 * direction(), direction()};
    const double away = *rc::gen::element(0.0, 1e-12, 1e-3, -1e-3, 0.1, 4.0, -4.0, 1e6, 1e9);
    const Eigen::Vector4d plane = testing::random_plane(ray.origin, away);
    const Vector3d normal = plane.head<3>();
    const double inverse = meet(plane_surface(plane), ray);
    RC_ASSERT(!std::isinf(inverse) && !(inverse < 0));
    const Real height = exact_plane_distance(plane, ray.origin);
    const double magnitude =
        (normal.cwiseProduct(ray.origin).cwiseAbs().sum() + std::abs(plane.w())) / normal.norm();
    if (static_cast<double>(abs(height)) <= 1e-15 * magnitude) return;  // through the eye
    const Real slope = dot(exact(normal), exact(ray.direction)) / norm(exact(normal));
    const Real truth = -slope / height;
    // n.d is a sum of three products, each of which is 1 at most.
    const double bound = 8 * kEpsilon * (1 + std::abs(static_cast<double>(slope))) /
                         std::abs(static_cast<double>(height));
    if (std::isnan(inverse)) {
      RC_ASSERT(static_cast<double>(truth) <= bound);
    } else {
      relative.expect(off(inverse, truth) / static_cast<double>(abs(truth)),
                      bound / static_cast<double>(abs(truth)));
    }
  }));
}

TEST(ProxyExtremes, APlaneThroughTheEyeIsMetNowhere) {
  EXPECT_TRUE(rc::check("any plane laid through any eye", [] {
    const WorldRay ray{random_origin() + 3 * direction(), direction()};
    RC_ASSERT(std::isnan(meet(plane_surface(testing::random_plane(ray.origin, 0)), ray)));
  }));
}

TEST(ProxyExtremes, APlaneOfAnyScaleOrAtInfinity) {
  const WorldRay ray{};
  EXPECT_EQ(meet(plane_surface({0, 0, 0, 1}), ray), 0);
  EXPECT_EQ(meet(plane_surface({0, 0, 0, -1e300}), ray), 0);
  for (const double scale : {1e-300, 1e-9, 1.0, 1e9, 1e300}) {
    EXPECT_NEAR(meet(plane_surface({0, 0, scale, 4 * scale}), ray), 0.25, 1e-15) << scale;
  }
  EXPECT_TRUE(std::isnan(meet(plane_surface({0, 1, 0, 0.5}), ray)));  // edge-on
}

/// Two triangles that form a square of 2 x `half`; every coordinate is a float with a short decimal
/// form.
struct Square {
  Vector3d origin, right, up;
  std::array<Vector3d, 4> corners() const {
    return {origin - right - up, origin + right - up, origin + right + up, origin - right + up};
  }
};

double on_grid(double metres) { return std::round(metres * 64) / 64; }
Vector3d on_grid(const Vector3d& v) {
  return v.unaryExpr([](double x) { return on_grid(x); });
}

Square some_square() {
  const double half = *rc::gen::element(0.25, 4.0, 500.0);
  const Vector3d right = direction();
  const Vector3d up = right.unitOrthogonal() + between(-0.7, 0.7) * right;
  return {on_grid(*rc::gen::element(0.0, 7.0, 2000.0) * direction()), on_grid(half * right),
          on_grid(half * up)};
}

void write_obj(const Square& square, const std::filesystem::path& file) {
  std::ofstream out(file);
  out << std::setprecision(12);
  for (const Vector3d& c : square.corners())
    out << "v " << c.x() << ' ' << c.y() << ' ' << c.z() << '\n';
  out << "f 1 2 3\nf 1 3 4\n";
}

TEST(ProxyExtremes, AMeshIsMetWhere50DigitsMeetIt) {
  WorstError relative("mesh: distance, relative to the mesh's size", 1e-5);
  const testing::TestFolder folder;
  const RaySurface nothing = [](std::span<const WorldRay> rays, std::span<double> inverse) {
    for (std::size_t i = 0; i < rays.size(); ++i) {
      inverse[i] = std::numeric_limits<double>::quiet_NaN();
    }
  };
  EXPECT_TRUE(rc::check("any square, eye and ray", [&] {
    const Square square = some_square();
    write_obj(square, folder.path() / "square.obj");
    const MeshProxy proxy(folder.path() / "square.obj");
    // Through its middle, along the edge between its triangles, near its border, or outside.
    const double a = *rc::gen::element(0.0, 0.3, -0.999, 1.5);
    const double b = *rc::gen::arbitrary<bool>() ? a : between(-0.99, 0.99);
    const Vector3d target = square.origin + a * square.right + b * square.up;
    const Vector3d normal = square.right.cross(square.up).normalized();
    const double away = *rc::gen::element(1e-3, 0.1, 4.0, -4.0, 1e3, 1e6);
    const Vector3d eye =
        target + away * (normal + *rc::gen::element(0.0, 0.5, 5.0) * square.right.normalized());
    const WorldRay ray{eye, (target - eye).normalized()};
    double inverse = 0;
    proxy.intersect({&ray, 1}, {&inverse, 1}, nothing);
    if (std::abs(a) > 1) {
      RC_ASSERT(std::isnan(inverse));
      return;
    }
    RC_ASSERT(inverse > 0 && std::isfinite(inverse));
    const ExactVector exact_normal = cross(exact(square.right), exact(square.up));
    const Real slope = dot(exact_normal, exact(ray.direction)) / norm(exact_normal);
    const Real truth = dot(exact_normal, exact(square.origin) - exact(eye)) /
                       dot(exact_normal, exact(ray.direction));
    // The rounding in float from just in front of the mesh: some roundings of its size, at the
    // ray's angle.
    const double size = 4 * (square.right.norm() + square.up.norm());
    const double bound =
        2 * std::numeric_limits<float>::epsilon() * size / std::abs(static_cast<double>(slope)) +
        8 * kEpsilon * static_cast<double>(truth);
    relative.expect(off(1 / inverse, truth) / size, bound / size);
  }));
}

}  // namespace
}  // namespace raystage::render
