// SPDX-License-Identifier: Apache-2.0
// Computes the linear functions of the pixel by which the kernels interpolate a slab: positions
// between the nodes of a cell, and positions u / ahead and v / ahead of the focal plane's point in
// the nodes' images, in samples. Cost: one homography per column and row of nodes, then constant
// per run.
#include "render/slabs/slab_runs.h"

#include <algorithm>
#include <cstddef>

namespace raystage::render {
namespace {

SlabRun::LinearFunction as_function(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

SlabRuns::SlabRuns(const Slab& slab, const SlabRays& rays, const PlaneProjection& projection)
    : slab_(slab), rays_(rays), projection_(projection) {
  const auto ideal_from_pixel = [&](int column, int row) {
    return projection.ideal_from_pixel(
        {slab.pose.world_from_camera_rotation, slab.node_position(column, row)});
  };
  const schemas::Intrinsics& image = slab.image;
  for (int column = 0; column < slab.columns; ++column) {
    const Eigen::Matrix3d ideal = ideal_from_pixel(column, 0);
    u_.push_back(as_function(image.fx * ideal.row(0) + image.cx * ideal.row(2)));
  }
  for (int row = 0; row < slab.rows; ++row) {
    const Eigen::Matrix3d ideal = ideal_from_pixel(0, row);
    v_.push_back(as_function(image.fy * ideal.row(1) + image.cy * ideal.row(2)));
  }
  ahead_ = as_function(ideal_from_pixel(0, 0).row(2));
}

SlabRun SlabRuns::run(const SlabRays::Run& part, int y) const {
  SlabRun run;
  run.begin = part.begin;
  run.end = part.end;
  run.y = y;
  run.width = slab_.width;
  run.height = slab_.height;
  // With one node along an axis both sides are equal, and the first has all weight.
  if (slab_.columns > 1) {
    run.column = as_function(rays_.column_numerator() - part.column * rays_.across());
  }
  if (slab_.rows > 1) run.row = as_function(rays_.row_numerator() - part.row * rays_.across());
  run.across = as_function(rays_.across());
  const auto column = static_cast<std::size_t>(part.column);
  const auto row = static_cast<std::size_t>(part.row);
  run.u = {u_[column], u_[std::min(column + 1, u_.size() - 1)]};
  run.v = {v_[row], v_[std::min(row + 1, v_.size() - 1)]};
  run.ahead = ahead_;
  run.slope = as_function(projection_.slope());
  run.distance = projection_.distance();
  run.at_infinity = projection_.at_infinity();
  return run;
}

}  // namespace raystage::render
