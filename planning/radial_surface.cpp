// SPDX-License-Identifier: Apache-2.0
// Finds the border of a volume along directions from its centre: in steps, then by bisection. The
// directions begin as an icosahedron. Where the border in the middle of a side is further from the
// side than 0.7 times the tolerance, the side is divided; triangles with one, two or three divided
// sides become two, three or four. Cost: some 40 tests for each vertex.
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
    find_border();
    // Coarse sides are divided before the border decides, so that a volume that is thin in some
    // directions is not missed.
    constexpr int kUnconditional = 3, kMaxRounds = 14;
    for (int round = 0; round < kMaxRounds && !options_.stop.stop_requested(); ++round) {
      if (!divide(round < kUnconditional)) break;
      options_.on_round();
    }
    return std::move(result_);
  }

 private:
  bool is_inside_at(const Vector3d& direction, double distance) const {
    return is_inside_(centre_ + distance * direction);
  }

  double bisect(const Vector3d& direction, double low, double high) const {
    while (high - low > options_.tolerance / 20) {
      const double middle = (low + high) / 2;
      (is_inside_at(direction, middle) ? low : high) = middle;
    }
    return low;
  }

  /// Returns the distance of the border along a direction, searched for in steps from the centre.
  double border(const Vector3d& direction) const {
    constexpr int kSteps = 100;
    const double step = options_.reach / kSteps;
    for (int i = 1; i <= kSteps; ++i) {
      if (!is_inside_at(direction, i * step)) return bisect(direction, (i - 1) * step, i * step);
    }
    return options_.reach;
  }

  /// Returns the same where the border is probably near to those of two neighbours.
  double border_between(const Vector3d& direction, double a, double b) const {
    constexpr double kMargin = 0.1;
    const double low = (1 - kMargin) * std::min(a, b);
    const double high = std::min(options_.reach, (1 + kMargin) * std::max(a, b));
    const bool is_bracketed =
        is_inside_at(direction, low) && (high >= options_.reach || !is_inside_at(direction, high));
    return is_bracketed ? bisect(direction, low, high) : border(direction);
  }

  void find_border() {
    raystage::parallel_for(std::size_t{0}, directions_.size(), [&](std::size_t i) {
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

  /// The border in the middle of a side.
  struct Middle {
    Vector3d direction, point;
    double error = 0;  ///< from the side
    int vertex = -1;   ///< of the surface, if the side is divided
  };

  Middle middle_of(const Side& side) const {
    Middle middle;
    middle.direction = (directions_[side.first] + directions_[side.second]).normalized();
    const auto distance = [&](int vertex) {
      return (result_.surface.vertices[vertex] - centre_).norm();
    };
    middle.point =
        centre_ + border_between(middle.direction, distance(side.first), distance(side.second)) *
                      middle.direction;
    middle.error = distance_from_side(side, middle.point);
    return middle;
  }

  /// Divides all sides, or those that are too far from the border. Returns false if none was.
  bool divide(bool all) {
    std::map<Side, Middle> middles;
    std::vector<Side> unknown;
    for (const Triangle& triangle : result_.surface.triangles) {
      for (std::size_t i = 0; i < 3; ++i) {
        const Side side = side_of(triangle[i], triangle[(i + 1) % 3]);
        const auto known = middles_.find(side);
        const bool is_new =
            middles.emplace(side, known == middles_.end() ? Middle{} : known->second).second;
        if (is_new && known == middles_.end()) unknown.push_back(side);
      }
    }
    std::vector<Middle> found(unknown.size());
    raystage::parallel_for(std::size_t{0}, unknown.size(), [&](std::size_t i) {
      if (!options_.stop.stop_requested()) found[i] = middle_of(unknown[i]);
    });
    if (options_.stop.stop_requested()) return false;
    for (std::size_t i = 0; i < unknown.size(); ++i) middles[unknown[i]] = found[i];
    middles_ = std::move(middles);
    result_.error = 0;
    bool divided = false;
    for (auto& [side, middle] : middles_) {
      const bool room = static_cast<int>(directions_.size()) < options_.max_vertices;
      // Elsewhere on a side or in a triangle the border may be further away than in the middle:
      // by a few per cent in coverage_rays_test.cpp, where cameras differ.
      constexpr double kElsewhere = 1 / 0.7;
      const double error = kElsewhere * middle.error;
      if ((!all && error <= options_.tolerance) || !room) {
        result_.error = std::max(result_.error, error);
        continue;
      }
      middle.vertex = static_cast<int>(directions_.size());
      directions_.push_back(middle.direction);
      result_.surface.vertices.push_back(middle.point);
      divided = true;
    }
    if (divided) split_triangles();
    return divided;
  }

  void split_triangles() {
    std::vector<Triangle> triangles;
    for (const Triangle& t : result_.surface.triangles) {
      std::array<int, 3> middle{};
      int count = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        middle[i] = middles_.at(side_of(t[i], t[(i + 1) % 3])).vertex;
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
  std::vector<Vector3d> directions_;  // of the vertices
  std::map<Side, Middle> middles_;
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
