// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "render/common/view.h"
#include "schemas/planes_document.h"

namespace raystage::render {

/// A flat convex polygon; rays that meet it, from either side, are sampled on its plane.
struct ObjectPlane {
  std::vector<Eigen::Vector3d> corners;  ///< in order, counter-clockwise as seen against the normal
  Eigen::Vector4d plane;                 ///< (unit normal, d): a x + b y + c z + d = 0, world
};

/// Returns the objects of the document `name`. Throws Error (bad input) with the object's position
/// in the document where corners lie off their plane by more than a hundredth of its size. Also
/// throws where the polygon has no area or is not convex.
std::vector<ObjectPlane> make_object_planes(const schemas::PlanesDocument& document,
                                            std::string_view name);

/// Returns the distance along the ray (in units of `direction`), above 0, at which it meets the
/// polygon, or nullopt. The border belongs to the polygon. This is the per-ray reference.
std::optional<double> intersect_ray(const ObjectPlane& object, const Eigen::Vector3d& origin,
                                    const Eigen::Vector3d& direction);

/// An interval of a row of a view, in pixels. A region has a list per row, from left to right.
struct PixelInterval {
  int begin = 0, end = 0;
  bool operator==(const PixelInterval&) const = default;
};
using ViewRegion = std::vector<std::vector<PixelInterval>>;

/// Returns a region of `view` (without its distortion) for each of `objects`, in their order: where
/// a ray meets that object first. One more region follows for rays that meet none. Every pixel is
/// in exactly one.
std::vector<ViewRegion> object_regions(const VirtualCamera& view,
                                       std::span<const ObjectPlane> objects);

/// Copies the pixels of `part` in `region` into `image` (of the same size) and adds up the
/// statistics. cameras_used becomes the maximum, because both may use the same cameras.
void insert_region(const RenderedView& part, const ViewRegion& region, RenderedView& image);

}  // namespace raystage::render
