// SPDX-License-Identifier: Apache-2.0
// Assigns pixels of a view to flat convex polygons. Each edge and the virtual camera span a plane,
// so that a row of pixels meets a polygon in one interval; the nearest polygon is used. Input:
// corners in the world, metres. Output: pixel intervals per row. Cost: rows x polygons x edges.

#include "render/planar/object_planes.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

constexpr double kMaxOffPlane = 0.01;  // of the polygon's size: corners are often set manually

Error refusal(std::string_view name, std::size_t index, const std::string& id,
              const std::string& what_happened, const std::string& what_to_do) {
  return Error::bad_input("object '" + id + "': " + what_happened,
                          fmt::format("{}#/planes/{}/corners", name, index), what_to_do);
}

/// The pixels whose rays pass through a polygon. Each edge and the eye span a plane, which cuts the
/// view along a line; the inside is on the positive side of all lines.
struct Outline {
  std::vector<Vector3d> edges;          // inside where edge.(x, y, 1) >= 0 for all
  Vector3d nearness{Vector3d::Zero()};  // inverse depth along the view's axis: nearness.(x, y, 1)

  bool contains(double x, double y) const {
    return std::ranges::all_of(edges,
                               [&](const Vector3d& e) { return e.dot(Vector3d(x, y, 1)) >= 0; });
  }
};

Outline outline_of(const VirtualCamera& view, const Eigen::Matrix3d& ray_from_pixel,
                   const ObjectPlane& object) {
  Outline outline;
  const double height = signed_plane_distance(object.plane, view.pose.position);
  if (height == 0) {  // edge-on: no ray meets it in a point
    outline.edges.push_back({0, 0, -1});
    return outline;
  }
  const std::size_t count = object.corners.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d from = object.corners[i] - view.pose.position;
    const Vector3d to = object.corners[(i + 1) % count] - view.pose.position;
    // An eye behind the plane sees the corners in the opposite order.
    const Vector3d inwards = height > 0 ? to.cross(from) : from.cross(to);
    const double length = inwards.norm();
    outline.edges.push_back(ray_from_pixel.transpose() *
                            (length > 0 ? Vector3d(inwards / length) : inwards));
  }
  const PlaneProjection projection(view, object.plane);
  outline.nearness = projection.slope() / projection.distance();
  return outline;
}

/// Returns the row's pixels inside: one interval, because the polygon is convex.
PixelInterval interval_of(const Outline& outline, int y, int width) {
  double least = 0, most = width;  // bounds of x for the search; contains() decides
  for (const Vector3d& edge : outline.edges) {
    const double constant = edge.y() * (y + 0.5) + edge.z();
    if (edge.x() > 0) {
      least = std::max(least, -constant / edge.x());
    } else if (edge.x() < 0) {
      most = std::min(most, -constant / edge.x());
    }
  }
  if (!(least <= most)) return {};
  const auto inside = [&](int x) { return outline.contains(x + 0.5, y + 0.5); };
  PixelInterval interval{std::max(0, static_cast<int>(std::floor(least)) - 1),
                         std::min(width, static_cast<int>(std::ceil(most)) + 1)};
  while (interval.begin < interval.end && !inside(interval.begin)) ++interval.begin;
  while (interval.begin < interval.end && !inside(interval.end - 1)) --interval.end;
  return interval.begin < interval.end ? interval : PixelInterval{};
}

}  // namespace

std::vector<ObjectPlane> make_object_planes(const schemas::PlanesDocument& document,
                                            std::string_view name) {
  std::vector<ObjectPlane> objects;
  for (std::size_t index = 0; index < document.planes.size(); ++index) {
    const schemas::PlanesDocument::Plane& given = document.planes[index];
    ObjectPlane object;
    Vector3d middle = Vector3d::Zero();
    for (const auto& corner : given.corners) {
      object.corners.emplace_back(corner[0], corner[1], corner[2]);
      middle += object.corners.back() / static_cast<double>(given.corners.size());
    }
    const std::size_t count = object.corners.size();
    Vector3d area = Vector3d::Zero();  // twice the area times the normal (Newell)
    double size = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Vector3d from = object.corners[i] - middle;
      area += from.cross(object.corners[(i + 1) % count] - middle);
      size = std::max(size, from.norm());
    }
    if (!(area.norm() > 1e-6 * size * size)) {
      throw refusal(name, index, given.id, "its corners have no area",
                    "Give the corners of a convex polygon");
    }
    const Vector3d normal = area.normalized();
    for (std::size_t i = 0; i < count; ++i) {
      const Vector3d& corner = object.corners[i];
      const double off = std::abs(normal.dot(corner - middle));
      if (off > kMaxOffPlane * size) {
        throw refusal(name, index, given.id,
                      fmt::format("corner {} is {:.3g} m from the plane of all corners", i, off),
                      "Give corners in one plane");
      }
      const Vector3d along = object.corners[(i + 1) % count] - corner;
      for (const Vector3d& other : object.corners) {
        if (normal.dot(along.cross(other - corner)) < -1e-6 * size * size) {
          throw refusal(name, index, given.id, "the polygon is not convex",
                        "Give the corners of a convex polygon in order, or divide it into several");
        }
      }
    }
    object.plane << normal, -normal.dot(middle);
    objects.push_back(std::move(object));
  }
  return objects;
}

std::optional<double> intersect_ray(const ObjectPlane& object, const Vector3d& origin,
                                    const Vector3d& direction) {
  const Vector3d normal = object.plane.head<3>();
  const double along = -signed_plane_distance(object.plane, origin) / normal.dot(direction);
  if (!(along > 0) || !std::isfinite(along)) return std::nullopt;
  const Vector3d point = along * direction;  // relative to the origin
  for (std::size_t i = 0; i < object.corners.size(); ++i) {
    const Vector3d from = object.corners[i] - origin;
    const Vector3d to = object.corners[(i + 1) % object.corners.size()] - origin;
    if (normal.dot((to - from).cross(point - from)) < 0) return std::nullopt;
  }
  return along;
}

std::vector<ViewRegion> object_regions(const VirtualCamera& view,
                                       std::span<const ObjectPlane> objects) {
  const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
  std::vector<Outline> outlines;
  for (const ObjectPlane& object : objects) {
    outlines.push_back(outline_of(view, ray_from_pixel, object));
  }
  std::vector<ViewRegion> regions(objects.size() + 1,
                                  ViewRegion(static_cast<std::size_t>(view.height)));
  raystage::parallel_for(0, view.height, [&](int y) {
    std::vector<std::size_t> owner(static_cast<std::size_t>(view.width), objects.size());
    std::vector<double> nearest(owner.size(), 0);
    for (std::size_t i = 0; i < outlines.size(); ++i) {
      const PixelInterval interval = interval_of(outlines[i], y, view.width);
      for (int x = interval.begin; x < interval.end; ++x) {
        const double nearness = outlines[i].nearness.dot(Vector3d(x + 0.5, y + 0.5, 1));
        if (!(nearness > nearest[x])) continue;
        nearest[x] = nearness;
        owner[x] = i;
      }
    }
    for (int begin = 0; begin < view.width;) {
      const std::size_t of = owner[begin];
      int end = begin + 1;
      while (end < view.width && owner[end] == of) ++end;
      regions[of][y].push_back({begin, end});
      begin = end;
    }
  });
  return regions;
}

void insert_region(const RenderedView& part, const ViewRegion& region, RenderedView& image) {
  raystage::parallel_for(0, image.height, [&](int y) {
    const auto row = static_cast<std::ptrdiff_t>(y) * image.width;
    for (const PixelInterval& interval : region[y]) {
      const auto copy = [&](const PixelValues& from, PixelValues& to, int channels) {
        std::copy(from.begin() + channels * (row + interval.begin),
                  from.begin() + channels * (row + interval.end),
                  to.begin() + channels * (row + interval.begin));
      };
      copy(part.rgba, image.rgba, 4);
      copy(part.coverage, image.coverage, 1);
      copy(part.z, image.z, 1);
    }
  });
  image.statistics.add_part(part.statistics);
}

}  // namespace raystage::render
