// SPDX-License-Identifier: Apache-2.0
// Kernel that computes the unit directions of up to 64 rays of a view's row, in double, and
// converts them to the floats of a RayChunk. Cost: O(rays). Must match world_ray_from_pixel()
// followed by fill_chunk() for single rays.
#include "render/lumigraph/ray_directions.h"

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/lumigraph/ray_directions.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Computes unit directions. `ray_from_pixel`: row-major.
void directions(const double* ray_from_pixel, int x, int y, int count, RayDirections& row) {
  const hn::ScalableTag<double> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  row.count = count;
  auto column = hn::Add(hn::Iota(d, 0), hn::Set(d, x + 0.5));
  for (int i = 0; i < count; i += lanes, column = hn::Add(column, hn::Set(d, lanes))) {
    const auto along = [&](int axis) HWY_ATTR {
      const double* m = ray_from_pixel + 3 * axis;
      return hn::MulAdd(hn::Set(d, m[0]), column, hn::Set(d, m[1] * (y + 0.5) + m[2]));
    };
    const auto right = along(0), up = along(1), back = along(2);
    const auto squared = hn::MulAdd(right, right, hn::MulAdd(up, up, hn::Mul(back, back)));
    const auto scale = hn::Div(hn::Set(d, 1.0), hn::Sqrt(squared));
    hn::Store(hn::Mul(right, scale), d, row.direction[0].data() + i);
    hn::Store(hn::Mul(up, scale), d, row.direction[1].data() + i);
    hn::Store(hn::Mul(back, scale), d, row.direction[2].data() + i);
  }
}

/// Converts a row's rays to a chunk. `from_middle`: the eye relative to the centre of the rig.
void fill(const double* from_middle, const RayDirections& row, const double* inverse_distance,
          RayChunk& chunk) {
  const hn::ScalableTag<double> d;
  const hn::Rebind<float, decltype(d)> df;
  const int lanes = static_cast<int>(hn::Lanes(d));
  chunk.count = row.count;
  HWY_ALIGN double inverses[RayChunk::kSize];
  std::copy_n(inverse_distance, row.count, inverses);
  std::fill(inverses + row.count, inverses + RayChunk::kSize,
            std::numeric_limits<double>::quiet_NaN());
  std::fill(chunk.inverse_distance.begin() + row.count, chunk.inverse_distance.end(),
            std::numeric_limits<float>::quiet_NaN());
  const auto store = [&](auto values, float* to)
                         HWY_ATTR { hn::StoreU(hn::DemoteTo(df, values), df, to); };
  for (int i = 0; i < row.count; i += lanes) {
    auto eye = hn::Zero(d);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto direction = hn::Load(d, row.direction[axis].data() + i);
      eye = hn::MulAdd(hn::Set(d, from_middle[axis]), direction, eye);
      store(direction, chunk.direction[axis].data() + i);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto direction = hn::Load(d, row.direction[axis].data() + i);
      store(hn::NegMulAdd(eye, direction, hn::Set(d, from_middle[axis])),
            chunk.base[axis].data() + i);
    }
    store(eye, chunk.eye.data() + i);
    const auto inverse = hn::Load(d, inverses + i);
    store(inverse, chunk.inverse_distance.data() + i);
    store(hn::MulAdd(eye, inverse, hn::Set(d, 1.0)), chunk.point.data() + i);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(directions);
HWY_EXPORT(fill);

void compute_ray_directions(const Eigen::Matrix3d& ray_from_pixel, int x, int y, int count,
                            RayDirections& row) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_rows = ray_from_pixel;
  HWY_DYNAMIC_DISPATCH(directions)(by_rows.data(), x, y, count, row);
}
void fill_chunk(const Eigen::Vector3d& eye, const RayDirections& row,
                std::span<const double> inverse_distance, const Eigen::Vector3d& middle,
                RayChunk& chunk) {
  const Eigen::Vector3d from_middle = eye - middle;
  HWY_DYNAMIC_DISPATCH(fill)(from_middle.data(), row, inverse_distance.data(), chunk);
}

}  // namespace raystage::render
#endif
