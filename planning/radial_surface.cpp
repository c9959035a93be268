// SPDX-License-Identifier: Apache-2.0
// Finds the border of a volume along directions from its centre: in steps, then by bisection. The
// directions begin as an icosahedron. Where the border in the middle of a side is further from the
// side than the tolerance, the side is divided; triangles with one, two or three divided sides
// become two, three or four. Cost: some 30 tests for each vertex.
#include "planning/radial_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "base/parallel.h"

namespace raystage::planning {
namespace {

using Eigen::Vector3d;
using Side = std::pair<int, int>;
using Triangle = std::array<int, 3>;

Side side_of(int a, int b) { return std::minmax(a, b); }

/// Returns the icosahedron with unit vertices.
ClosedSurface icosahedron() {
  constexpr double kGolden = std::numbers::phi;
  ClosedSurface surface;
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-kGolden, kGolden}) {
      surface.vertices.emplace_back(0, a, b);
      surface.vertices.emplace_back(a, b, 0);
      surface.vertices.emplace_back(b, 0, a);
    }
  }
  for (Vector3d& vertex : surface.vertices) vertex.normalize();
  // A face is three vertices that are all as far apart as neighbours are.
  const auto is_side = [&](std::size_t i, std::size_t j) {
    return (surface.vertices[i] - surface.vertices[j]).norm() < 1.2;
  };
  const std::size_t count = surface.vertices.size();
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count; ++j) {
      for (std::size_t k = j + 1; k < count; ++k) {
        if (!is_side(i, j) || !is_side(j, k) || !is_side(i, k)) continue;
        Triangle face{static_cast<int>(i), static_cast<int>(j), static_cast<int>(k)};
        const Vector3d &a = surface.vertices[i], &b = surface.vertices[j], &c = surface.vertices[k];
        if ((b - a).cross(c - a).dot(a) < 0) std::swap(face[1], face[2]);
        surface.triangles.push_back(face);
      }
    }
  }
  return surface;
}

class Search {
 public:
  Search(const std::function<bool(const Vector3d&)>& is_inside, const Vector3d& centre,
         const RadialSurfaceOptions& options)
      : is_inside_(is_inside), centre_(centre), options_(options) {}

  RadialSurface run() {
    result_.surface = icosahedron();
    directions_ = result_.surface.vertices;
    find_border(0);
    // Coarse sides are divided before the border decides, so that a volume that is thin in some
    // directions is not missed.
    constexpr int kUnconditional = 3, kMaxRounds = 14;
    for (int round = 0; round < kMaxRounds; ++round) {
      if (!divide(round < kUnconditional)) break;
    }
    return std::move(result_);
  }

 private:
  double border(const Vector3d& direction) const {
    constexpr int kSteps = 100;
    const auto inside = [&](double distance) { return is_inside_(centre_ + distance * direction); };
    const double step = options_.reach / kSteps;
    double low = 0, high = options_.reach;
    for (int i = 1; i <= kSteps; ++i) {
      if (inside(i * step)) {
        low = i * step;
      } else {
        high = i * step;
        break;
      }
    }
    if (low == options_.reach) return low;
    while (high - low > options_.tolerance / 20) {
      const double middle = (low + high) / 2;
      (inside(middle) ? low : high) = middle;
    }
    return low;
  }

  void find_border(std::size_t first) {
    result_.surface.vertices.resize(directions_.size());
    raystage::parallel_for(first, directions_.size(), [&](std::size_t i) {
      result_.surface.vertices[i] = centre_ + border(directions_[i]) * directions_[i];
    });
  }

  /// Returns how far a border point is from the line through the ends of a side.
  double distance_from_side(const Side& side, const Vector3d& point) const {
    const Vector3d& from = result_.surface.vertices[side.first];
    const Vector3d along = result_.surface.vertices[side.second] - from;
    const double squared = along.squaredNorm();
    const double share =
        squared > 0 ? std::clamp(along.dot(point - from) / squared, 0.0, 1.0) : 0.0;
    return (point - from - share * along).norm();
  }

  /// Divides all sides, or those that are too far from the border. Returns false if none was.
  bool divide(bool all) {
    std::map<Side, int> middles;  // by side: index of the vertex in its middle
    std::vector<Side> sides;
    for (const Triangle& triangle : result_.surface.triangles) {
      for (std::size_t i = 0; i < 3; ++i) {
        const Side side = side_of(triangle[i], triangle[(i + 1) % 3]);
        if (middles.try_emplace(side, -1).second) sides.push_back(side);
      }
    }
    std::vector<Vector3d> points(sides.size());
    std::vector<double> errors(sides.size());
    raystage::parallel_for(std::size_t{0}, sides.size(), [&](std::size_t i) {
      const Vector3d direction =
          (directions_[sides[i].first] + directions_[sides[i].second]).normalized();
      points[i] = centre_ + border(direction) * direction;
      errors[i] = distance_from_side(sides[i], points[i]);
    });
    result_.error = 0;
    bool divided = false;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      const bool room = static_cast<int>(directions_.size()) < options_.max_vertices;
      if ((!all && errors[i] <= options_.tolerance) || !room) {
        result_.error = std::max(result_.error, errors[i]);
        continue;
      }
      middles[sides[i]] = static_cast<int>(directions_.size());
      directions_.push_back((points[i] - centre_).norm() > 0
                                ? Vector3d((points[i] - centre_).normalized())
                                : directions_[sides[i].first]);
      result_.surface.vertices.push_back(points[i]);
      divided = true;
    }
    if (divided) split_triangles(middles);
    return divided;
  }

  void split_triangles(const std::map<Side, int>& middles) {
    std::vector<Triangle> triangles;
    for (const Triangle& t : result_.surface.triangles) {
      std::array<int, 3> middle{};
      int count = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        middle[i] = middles.at(side_of(t[i], t[(i + 1) % 3]));
        count += middle[i] >= 0 ? 1 : 0;
      }
      // Turned so that the first side is divided, and the last one is not if there is one.
      std::size_t turn = 0;
      while (count > 0 && count < 3 && (middle[turn] < 0 || middle[(turn + 2) % 3] >= 0)) {
        turn = (turn + 1) % 3;
      }
      const int a = t[turn], b = t[(turn + 1) % 3], c = t[(turn + 2) % 3];
      const int ab = middle[turn], bc = middle[(turn + 1) % 3], ca = middle[(turn + 2) % 3];
      if (count == 0) {
        triangles.push_back(t);
      } else if (count == 1) {
        triangles.insert(triangles.end(), {{a, ab, c}, {ab, b, c}});
      } else if (count == 2) {
        triangles.insert(triangles.end(), {{ab, b, bc}, {a, ab, bc}, {a, bc, c}});
      } else {
        triangles.insert(triangles.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
      }
    }
    result_.surface.triangles = std::move(triangles);
  }

  const std::function<bool(const Vector3d&)>& is_inside_;
  Vector3d centre_;
  RadialSurfaceOptions options_;
  std::vector<Vector3d> directions_;
  RadialSurface result_;
};

}  // namespace

double ClosedSurface::volume() const {
  double six_fold = 0;
  for (const std::array<int, 3>& t : triangles) {
    const Vector3d& origin = vertices[triangles.front()[0]];
    six_fold +=
        (vertices[t[0]] - origin).dot((vertices[t[1]] - origin).cross(vertices[t[2]] - origin));
  }
  return six_fold / 6;
}

ClosedSurface surface_of(const rig::ConvexPolyhedron& polyhedron) {
  ClosedSurface surface;
  surface.vertices = polyhedron.vertices();
  for (const rig::ConvexPolyhedron::Face& face : polyhedron.faces()) {
    for (std::size_t i = 2; i < face.vertices.size(); ++i) {
      surface.triangles.push_back({face.vertices[0], face.vertices[i - 1], face.vertices[i]});
    }
  }
  return surface;
}

RadialSurface radial_surface(const std::function<bool(const Vector3d&)>& is_inside,
                             const Vector3d& centre, const RadialSurfaceOptions& options) {
  return Search(is_inside, centre, options).run();
}

}  // namespace raystage::planning
