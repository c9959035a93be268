// SPDX-License-Identifier: Apache-2.0
#include "testing/render/transfer_probe.h"

#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "testing/render/transfer_probe.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/depth/transfer-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::testing {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

TransferredPixel probe(const render::PixelTransfer& transfer, int x, int y, float inverse_depth,
                       int width, int height) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d)), lane = x % lanes;
  HWY_ALIGN float u[hn::MaxLanes(d)], v[hn::MaxLanes(d)], depth[hn::MaxLanes(d)],
      inside[hn::MaxLanes(d)];
  const render::HWY_NAMESPACE::RowTransfer along(transfer, y, width, height);
  const auto place = along.at(d, x - lane, hn::Set(d, inverse_depth));
  hn::Store(place.u, d, u);
  hn::Store(place.v, d, v);
  hn::Store(place.inverse_depth, d, depth);
  hn::Store(hn::IfThenElseZero(place.inside, hn::Set(d, 1.0F)), d, inside);
  const auto i = static_cast<std::size_t>(lane);
  return {u[i], v[i], depth[i], inside[i] != 0};
}

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::testing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::testing {

HWY_EXPORT(probe);
HWY_EXPORT(target);

TransferredPixel probe_transfer(const render::PixelTransfer& transfer, int x, int y,
                                float inverse_depth, int width, int height) {
  return HWY_DYNAMIC_DISPATCH(probe)(transfer, x, y, inverse_depth, width, height);
}
const char* transfer_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage::testing
#endif
