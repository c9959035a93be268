// SPDX-License-Identifier: Apache-2.0
#include "render/sweep/cost_kernels.h"

#include <cstring>

#include "render/matching/matching.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sweep/cost_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/lens-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Codes are worked on with four bits behind the point, two in a 32-bit lane, weights with thirteen.
constexpr int kCodeBits = 4;
constexpr float kWeightOne = 8192;

/// Where a camera sees the planes' points on one ray, vectors across planes.
void find_positions(const MatchingCamera& camera, const CostRun& run, int x, CostScratch& scratch,
                    std::uint32_t* seen) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto set = [&](double value) HWY_ATTR { return hn::Set(d, static_cast<float>(value)); };
  const double* m = camera.source.camera.ideal_from_pixel.data();
  const auto& deep = camera.source.per_inverse_depth;
  // Linear in the plane: at plane 0, and from plane to plane.
  const auto at_first = [&](std::size_t r) {
    return m[3 * r] * (x + 0.5) + m[3 * r + 1] * (run.y + 0.5) + m[3 * r + 2] +
           run.planes.farthest * deep[r];
  };
  const auto base_x = set(at_first(0)), base_y = set(at_first(1)), base_w = set(at_first(2));
  const auto step_x = set(run.planes.step * deep[0]), step_y = set(run.planes.step * deep[1]);
  const auto step_w = set(run.planes.step * deep[2]);
  const auto zero = hn::Zero(d), one = set(1), half = set(0.5), weight_one = set(kWeightOne);
  const auto last_x = set(camera.source.camera.width - 1);
  const auto last_y = set(camera.source.camera.height - 1);
  const auto pitch = hn::Set(di, static_cast<std::int32_t>(camera.pitch));
  for (int plane = 0; plane < run.planes.count; plane += lanes) {
    const auto steps = hn::Iota(d, static_cast<float>(plane));
    const auto w = hn::MulAdd(steps, step_w, base_w);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    const auto sight =
        through_lens(d, camera.source.camera, hn::Mul(hn::MulAdd(steps, step_x, base_x), inverse),
                     hn::Mul(hn::MulAdd(steps, step_y, base_y), inverse), in_front);
    const auto left = hn::Min(hn::Max(hn::Sub(sight.u, half), zero), last_x);
    const auto top = hn::Min(hn::Max(hn::Sub(sight.v, half), zero), last_y);
    const auto column = hn::ConvertTo(di, left), row = hn::ConvertTo(di, top);
    const auto right = hn::Sub(left, hn::ConvertTo(d, column));
    const auto down = hn::Sub(top, hn::ConvertTo(d, row));
    const auto twice = [&](auto part) HWY_ATTR {
      const auto weight = hn::BitCast(du, hn::ConvertTo(di, hn::Mul(part, weight_one)));
      return hn::Or(weight, hn::ShiftLeft<16>(weight));
    };
    hn::StoreU(hn::Add(hn::Mul(row, pitch), column), di, scratch.offsets() + plane);
    hn::StoreU(twice(right), du, scratch.right() + plane);
    hn::StoreU(twice(down), du, scratch.down() + plane);
    hn::StoreU(hn::BitCast(du, hn::VecFromMask(d, hn::Gt(sight.seen, zero))), du, seen + plane);
  }
}

/// Two neighbours at a time. A pass of its own: wide loads right behind narrow stores would stall.
void gather(const MatchingCamera& camera, int planes, CostScratch& scratch) {
  constexpr std::size_t kTwo = 2 * sizeof(std::uint32_t);
  const std::int32_t* offsets = scratch.offsets();
  std::uint32_t* HWY_RESTRICT upper = scratch.upper();
  std::uint32_t* HWY_RESTRICT lower = scratch.lower();
  for (int plane = 0; plane < planes; ++plane) {
    const std::uint32_t* at = camera.pixels + offsets[plane];
    std::memcpy(upper + 2 * plane, at, kTwo);
    std::memcpy(lower + 2 * plane, at + camera.pitch, kTwo);
  }
}

template <class D, class V>
HWY_INLINE V between(D d, V from, V to, V weight) {
  const hn::Repartition<std::int16_t, D> d16;
  const auto way = hn::ShiftLeft<3>(hn::Sub(hn::BitCast(d16, to), hn::BitCast(d16, from)));
  const auto part = hn::MulHigh(way, hn::BitCast(d16, weight));
  return hn::BitCast(d, hn::Add(hn::BitCast(d16, from), part));
}

/// R and B, and G, of each plane's bilinear sample.
void interpolate(int planes, CostScratch& scratch, const CostScratch::Camera& out) {
  const hn::ScalableTag<std::uint32_t> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto rb_mask = hn::Set(d, 0x0FF00FF0U), g_mask = hn::Set(d, 0x00000FF0U);
  const auto rb = [&](auto v) HWY_ATTR { return hn::And(hn::ShiftLeft<kCodeBits>(v), rb_mask); };
  const auto g = [&](auto v) HWY_ATTR { return hn::And(hn::ShiftRight<kCodeBits>(v), g_mask); };
  const std::uint32_t* upper = scratch.upper();
  const std::uint32_t* lower = scratch.lower();
  for (int plane = 0; plane < planes; plane += lanes) {
    const auto u0 = hn::LoadU(d, upper + 2 * plane), u1 = hn::LoadU(d, upper + 2 * plane + lanes);
    const auto l0 = hn::LoadU(d, lower + 2 * plane), l1 = hn::LoadU(d, lower + 2 * plane + lanes);
    const auto upper_left = hn::ConcatEven(d, u1, u0), upper_right = hn::ConcatOdd(d, u1, u0);
    const auto lower_left = hn::ConcatEven(d, l1, l0), lower_right = hn::ConcatOdd(d, l1, l0);
    const auto right = hn::LoadU(d, scratch.right() + plane);
    const auto down = hn::LoadU(d, scratch.down() + plane);
    const auto red_blue = between(d, between(d, rb(upper_left), rb(upper_right), right),
                                  between(d, rb(lower_left), rb(lower_right), right), down);
    const auto green = between(d, between(d, g(upper_left), g(upper_right), right),
                               between(d, g(lower_left), g(lower_right), right), down);
    hn::StoreU(red_blue, d, out.red_blue + plane);
    hn::StoreU(green, d, out.green + plane);
  }
}

/// |a - b| of unsigned 16-bit halves.
template <class D, class V>
HWY_INLINE V difference(D d, V a, V b) {
  const hn::Repartition<std::uint16_t, D> d16;
  const auto x = hn::BitCast(d16, a), y = hn::BitCast(d16, b);
  return hn::BitCast(d, hn::Or(hn::SaturatedSub(x, y), hn::SaturatedSub(y, x)));
}

void compare(const CostRun& run, CostScratch& scratch, std::uint8_t* costs) {
  const hn::ScalableTag<std::uint32_t> d;
  const hn::Repartition<std::uint16_t, decltype(d)> d16;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToFloat<decltype(d)> df;
  const hn::Rebind<std::uint8_t, decltype(d)> d8;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int cameras = static_cast<int>(run.cameras.size());
  const auto most = static_cast<std::uint32_t>(run.truncation * 3 * (1 << kCodeBits));
  const auto truncation = hn::Set(d, most);
  const auto scale = hn::Set(df, 255.0F / static_cast<float>(most));
  const auto two = hn::Set(df, 2.0F);
  const auto low_half = hn::Set(d, 0xFFFFU);
  const auto unknown = hn::Set(df, static_cast<float>(kUnknownCost));
  const auto add16 = [&](auto a, auto b) HWY_ATTR {
    return hn::BitCast(d, hn::Add(hn::BitCast(d16, a), hn::BitCast(d16, b)));
  };
  for (int plane = 0; plane < run.planes.count; plane += lanes) {
    auto red_blue = hn::Zero(d), green = hn::Zero(d), count = hn::Zero(d);
    for (int i = 0; i < cameras; ++i) {
      const CostScratch::Camera camera = scratch.camera(i);
      const auto seen = hn::LoadU(d, camera.seen + plane);
      red_blue = add16(red_blue, hn::And(seen, hn::LoadU(d, camera.red_blue + plane)));
      green = add16(green, hn::And(seen, hn::LoadU(d, camera.green + plane)));
      count = hn::Sub(count, seen);  // -1 where it sees
    }
    const auto n = hn::ConvertTo(df, hn::BitCast(di, count));
    const auto per_camera = hn::Div(hn::Set(df, 1.0F), hn::Max(n, two));
    const auto part = hn::BitCast(d, hn::ConvertTo(di, hn::Mul(per_camera, hn::Set(df, 65536.0F))));
    const auto parts = hn::Or(part, hn::ShiftLeft<16>(part));
    const auto mean = [&](auto sum) HWY_ATTR {
      return hn::BitCast(d, hn::MulHigh(hn::BitCast(d16, sum), hn::BitCast(d16, parts)));
    };
    const auto mean_red_blue = mean(red_blue), mean_green = mean(green);
    auto sum = hn::Zero(d);
    for (int i = 0; i < cameras; ++i) {
      const CostScratch::Camera camera = scratch.camera(i);
      const auto off_rb = difference(d, hn::LoadU(d, camera.red_blue + plane), mean_red_blue);
      const auto off_g = difference(d, hn::LoadU(d, camera.green + plane), mean_green);
      const auto off = add16(off_rb, off_g);
      const auto all = hn::Add(hn::And(off, low_half), hn::ShiftRight<16>(off));
      sum = hn::Add(sum, hn::And(hn::Min(all, truncation), hn::LoadU(d, camera.seen + plane)));
    }
    const auto cost = hn::Mul(hn::Mul(hn::ConvertTo(df, hn::BitCast(di, sum)), scale), per_camera);
    const auto known = hn::IfThenElse(hn::Ge(n, two), cost, unknown);
    hn::StoreU(hn::DemoteTo(d8, hn::NearestInt(known)), d8, costs + plane);
  }
}

void fill(const CostRun& run, CostScratch& scratch) {
  const int stride = plane_stride(run.planes.count);
  for (int x = run.begin; x < run.end; ++x) {
    for (std::size_t i = 0; i < run.cameras.size(); ++i) {
      const CostScratch::Camera out = scratch.camera(static_cast<int>(i));
      find_positions(*run.cameras[i], run, x, scratch, out.seen);
      gather(*run.cameras[i], run.planes.count, scratch);
      interpolate(run.planes.count, scratch, out);
    }
    compare(run, scratch, run.costs + static_cast<std::ptrdiff_t>(x - run.begin) * stride);
  }
}

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage {

HWY_EXPORT(fill);
HWY_EXPORT(target);

void fill_costs(const CostRun& run, CostScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(fill)(run, scratch);
}
const char* sweep_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage
#endif
