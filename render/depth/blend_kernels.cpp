// SPDX-License-Identifier: Apache-2.0
#include "render/depth/blend_kernels.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/depth/blend_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/depth/transfer-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

void visibility(const VisibilityRun& run) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d)), count = static_cast<int>(run.visible.size());
  const int width = run.depths->width, height = run.depths->height;
  const RowTransfer transfer(run.transfer, run.y, width, height);
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F);
  const auto last_x = hn::Set(d, static_cast<float>(width - 1));
  const auto last_y = hn::Set(d, static_cast<float>(height - 1));
  const auto right_most = hn::Set(di, width - 1), lowest = hn::Set(di, height - 1);
  const auto next = hn::Set(di, 1), pitch = hn::Set(di, width);
  // (hidden - excess / tolerance) / (hidden - 1), cut off at 0 and 1.
  const auto slope = hn::Set(d, 1 / (run.tolerance * (kHiddenBehind - 1)));
  const auto top = hn::Set(d, kHiddenBehind / (kHiddenBehind - 1));
  const float* values = run.depths->values.data();
  HWY_ALIGN float inverse_depth[kMostRun], visible[kMostRun];
  std::fill_n(inverse_depth, kMostRun, 0.0F);
  std::copy(run.inverse_depth.begin(), run.inverse_depth.end(), inverse_depth);
  for (int i = 0; i < count; i += lanes) {
    const auto place = transfer.at(d, run.x + i, hn::Load(d, inverse_depth + i));
    const auto u = hn::Min(hn::Max(hn::Sub(place.u, half), zero), last_x);
    const auto v = hn::Min(hn::Max(hn::Sub(place.v, half), zero), last_y);
    const auto x0 = hn::ConvertTo(di, u), y0 = hn::ConvertTo(di, v);
    const auto right = hn::Sub(u, hn::ConvertTo(d, x0)), down = hn::Sub(v, hn::ConvertTo(d, y0));
    const auto x1 = hn::Min(hn::Add(x0, next), right_most), y1 = hn::Min(hn::Add(y0, next), lowest);
    const auto sight = [&](auto x, auto y) HWY_ATTR {
      const auto its = hn::GatherIndex(d, values, hn::Add(hn::Mul(y, pitch), x));
      const auto excess = hn::Sub(its, place.inverse_depth);
      return hn::Min(one, hn::Max(zero, hn::NegMulAdd(excess, slope, top)));
    };
    const auto upper_left = sight(x0, y0), lower_left = sight(x0, y1);
    const auto upper = hn::MulAdd(right, hn::Sub(sight(x1, y0), upper_left), upper_left);
    const auto lower = hn::MulAdd(right, hn::Sub(sight(x1, y1), lower_left), lower_left);
    const auto seen = hn::MulAdd(down, hn::Sub(lower, upper), upper);
    hn::Store(hn::IfThenElse(place.inside, seen, one), d, visible + i);
  }
  std::copy_n(visible, count, run.visible.begin());
}

void blend(const BlendRun& run, std::span<float> sums) {
  const hn::FixedTag<float, 4> d;
  const auto cameras = run.samples.size();
  const auto per_agreement = 1 / (3 * run.agreement * run.agreement);
  for (int i = 0; i < run.count; ++i) {
    // R, G, B and seen of each sample hold the camera's share of seen already in their fourth.
    auto sum = hn::Zero(d);
    float alpha = 0;
    for (std::size_t c = 0; c < cameras; ++c) {
      const auto sample = hn::LoadU(d, run.samples[c] + 4 * i);
      sum = hn::MulAdd(hn::Set(d, run.shares[c][i] * (run.visible[c][i] + kHiddenShare)), sample,
                       sum);
      alpha += run.shares[c][i] * run.samples[c][4 * i + 3];
    }
    constexpr int kRounds = 2;
    for (int round = 0; round < kRounds; ++round) {
      const auto weight = hn::Broadcast<3>(sum);
      if (!(hn::GetLane(weight) > 0)) break;
      // Samples are premultiplied by seen * 65535; so is the mean that they are held against.
      const auto mean = hn::Div(sum, weight);
      auto next = hn::Zero(d);
      for (std::size_t c = 0; c < cameras; ++c) {
        const float seen = run.samples[c][4 * i + 3];
        if (!(seen > 0)) continue;
        const auto sample = hn::LoadU(d, run.samples[c] + 4 * i);
        const auto off = hn::NegMulAdd(mean, hn::Set(d, seen), sample);
        const float distance = hn::GetLane(hn::SumOfLanes(d, hn::Mul(off, off)));
        const float scale = 65535 / seen;  // back to codes
        const float trust = 1 / (1 + distance * scale * scale * per_agreement);
        const float share = run.shares[c][i] * (run.visible[c][i] + kHiddenShare) * trust;
        next = hn::MulAdd(hn::Set(d, share), sample, next);
      }
      sum = next;
    }
    const float weight = hn::GetLane(hn::Broadcast<3>(sum));
    hn::StoreU(hn::Mul(sum, hn::Set(d, weight > 0 ? alpha / weight : 0)), d, sums.data() + 4 * i);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage {

HWY_EXPORT(visibility);
HWY_EXPORT(blend);

void find_visibility(const VisibilityRun& run) { HWY_DYNAMIC_DISPATCH(visibility)(run); }
void blend_agreeing(const BlendRun& run, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(blend)(run, sums);
}

}  // namespace raystage
#endif
