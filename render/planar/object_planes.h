// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "render/common/view.h"
#include "schemas/planes_document.h"

namespace raystage {

/// A flat convex polygon: rays that meet it, from either side, are looked up on its plane.
struct ObjectPlane {
  std::vector<Eigen::Vector3d> corners;  ///< around it, counter-clockwise seen against the normal
  Eigen::Vector4d plane;                 ///< (unit normal, d): a x + b y + c z + d = 0, world
};

/// Throws Error (bad input) with the object's place in the document `name`: corners that lie off
/// their plane by more than a hundredth of its size, no area, or not convex.
std::vector<ObjectPlane> make_object_planes(const PlanesDocument& document, std::string_view name);

/// How far along the ray (units of `direction`), above 0, it meets the polygon, if it does; its
/// border belongs to it. Ray by ray: the slow, obvious way.
std::optional<double> intersect_ray(const ObjectPlane& object, const Eigen::Vector3d& origin,
                                    const Eigen::Vector3d& direction);

/// Pixels of a view: per row, from left to right.
struct PixelInterval {
  int begin = 0, end = 0;
  bool operator==(const PixelInterval&) const = default;
};
using ViewRegion = std::vector<std::vector<PixelInterval>>;

/// Where in `view` (without its distortion) which object is met first: a region for each of
/// `objects` in their order, and behind them one more for what meets none. Every pixel is in one.
std::vector<ViewRegion> object_regions(const VirtualCamera& view,
                                       std::span<const ObjectPlane> objects);

/// Puts what `part` shows in `region` into `image` (of the same size), and adds what it took; of
/// cameras_used the larger, as both may use the same.
void insert_region(const RenderedView& part, const ViewRegion& region, RenderedView& image);

}  // namespace raystage
