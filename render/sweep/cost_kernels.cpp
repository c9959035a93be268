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

// Codes are worked on with four bits behind the point, two in a 32-bit lane; weights of the four
// neighbours have eight.
constexpr int kCodeBits = 4;
constexpr double kWeightOne = 256;

/// Where a camera sees the planes' points on one ray, vectors across planes. Returns whether it
/// sees them all.
bool find_positions(const MatchingCamera& camera, const CostRun& run, int x, CostScratch& scratch,
                    std::uint32_t* seen) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto set = [&](double value) HWY_ATTR { return hn::Set(d, static_cast<float>(value)); };
  const SourceView& lens = camera.source.camera;
  const double* m = lens.ideal_from_pixel.data();
  const auto& deep = camera.source.per_inverse_depth;
  // Linear in the plane: at plane 0, and from plane to plane.
  const auto at_first = [&](std::size_t r) {
    return m[3 * r] * (x + 0.5) + m[3 * r + 1] * (run.y + 0.5) + m[3 * r + 2] +
           run.planes.farthest * deep[r];
  };
  double first[3] = {at_first(0), at_first(1), at_first(2)};
  double step[3] = {run.planes.step * deep[0], run.planes.step * deep[1],
                    run.planes.step * deep[2]};
  if (!lens.distorted) {  // pixels at once, without a lens in between
    const double focal[2] = {lens.fx, lens.fy}, centre[2] = {lens.cx, lens.cy};
    for (int i = 0; i < 2; ++i) {
      first[i] = focal[i] * first[i] + centre[i] * first[2];
      step[i] = focal[i] * step[i] + centre[i] * step[2];
    }
  }
  const auto base_x = set(first[0]), base_y = set(first[1]), base_w = set(first[2]);
  const auto step_x = set(step[0]), step_y = set(step[1]), step_w = set(step[2]);
  const auto zero = hn::Zero(d), one = set(1), weight_one = set(kWeightOne);
  // From the outermost centre, and so that cutting off rounds to the nearest weight.
  const auto origin = set(0.5 - 0.5 / kWeightOne);
  const auto width = set(lens.width), height = set(lens.height);
  const auto last_x = set(lens.width - 1), last_y = set(lens.height - 1);
  const auto pitch = hn::Set(di, static_cast<std::int32_t>(camera.pitch));
  auto all_seen = hn::Set(du, 0xFFFFFFFFU);
  for (int plane = 0; plane < run.planes.count; plane += lanes) {
    const auto steps = hn::Iota(d, static_cast<float>(plane));
    const auto w = hn::MulAdd(steps, step_w, base_w);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    auto u = hn::Mul(hn::MulAdd(steps, step_x, base_x), inverse);
    auto v = hn::Mul(hn::MulAdd(steps, step_y, base_y), inverse);
    auto sees = in_front;
    if (lens.distorted) {
      const auto sight = through_lens(d, lens, u, v, in_front);
      u = sight.u;
      v = sight.v;
      sees = hn::Gt(sight.seen, zero);
    } else {
      sees = hn::And(sees, hn::And(hn::And(hn::Gt(u, zero), hn::Lt(u, width)),
                                   hn::And(hn::Gt(v, zero), hn::Lt(v, height))));
    }
    const auto left = hn::Min(hn::Max(hn::Sub(u, origin), zero), last_x);
    const auto top = hn::Min(hn::Max(hn::Sub(v, origin), zero), last_y);
    const auto column = hn::ConvertTo(di, left), row = hn::ConvertTo(di, top);
    const auto twice = [&](auto part) HWY_ATTR {
      const auto weight = hn::BitCast(du, hn::ConvertTo(di, hn::Mul(part, weight_one)));
      return hn::Or(weight, hn::ShiftLeft<16>(weight));
    };
    const auto seen_here = hn::BitCast(du, hn::VecFromMask(d, sees));
    hn::StoreU(hn::Add(hn::Mul(row, pitch), column), di, scratch.offsets() + plane);
    hn::StoreU(twice(hn::Sub(left, hn::ConvertTo(d, column))), du, scratch.right() + plane);
    hn::StoreU(twice(hn::Sub(top, hn::ConvertTo(d, row))), du, scratch.down() + plane);
    hn::StoreU(seen_here, du, seen + plane);
    all_seen = hn::And(all_seen, seen_here);
  }
  return hn::AllTrue(du, hn::Ne(all_seen, hn::Zero(du)));
}

/// Two neighbours at a time. A pass of its own: wide loads right behind narrow stores would stall.
void gather(const MatchingCamera& camera, int planes, CostScratch& scratch) {
  constexpr std::size_t kTwo = 2 * sizeof(std::uint32_t);
  const std::uint32_t* const pixels = camera.pixels;  // what is stored may be anything, else
  const std::ptrdiff_t pitch = camera.pitch;
  const std::int32_t* HWY_RESTRICT offsets = scratch.offsets();
  std::uint32_t* HWY_RESTRICT upper = scratch.upper();
  std::uint32_t* HWY_RESTRICT lower = scratch.lower();
  for (int plane = 0; plane < planes; ++plane) {
    const std::uint32_t* at = pixels + offsets[plane];
    std::memcpy(upper + 2 * plane, at, kTwo);
    std::memcpy(lower + 2 * plane, at + pitch, kTwo);
  }
}

/// R and B, and G, of each plane's bilinear sample.
void interpolate(int planes, CostScratch& scratch, const CostScratch::Camera& out) {
  const hn::ScalableTag<std::uint32_t> d;
  const hn::Repartition<std::uint16_t, decltype(d)> d16;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto rb_mask = hn::Set(d, 0x00FF00FFU), g_mask = hn::Set(d, 0x000000FFU);
  const auto one = hn::Set(d16, static_cast<std::uint16_t>(kWeightOne));
  const auto red_blue = [&](auto v) HWY_ATTR { return hn::BitCast(d16, hn::And(v, rb_mask)); };
  const auto green = [&](auto v) HWY_ATTR {
    return hn::BitCast(d16, hn::And(hn::ShiftRight<8>(v), g_mask));
  };
  const std::uint32_t* upper = scratch.upper();
  const std::uint32_t* lower = scratch.lower();
  for (int plane = 0; plane < planes; plane += lanes) {
    const auto u0 = hn::LoadU(d, upper + 2 * plane), u1 = hn::LoadU(d, upper + 2 * plane + lanes);
    const auto l0 = hn::LoadU(d, lower + 2 * plane), l1 = hn::LoadU(d, lower + 2 * plane + lanes);
    const auto upper_left = hn::ConcatEven(d, u1, u0), upper_right = hn::ConcatOdd(d, u1, u0);
    const auto lower_left = hn::ConcatEven(d, l1, l0), lower_right = hn::ConcatOdd(d, l1, l0);
    const auto right = hn::BitCast(d16, hn::LoadU(d, scratch.right() + plane));
    const auto down = hn::BitCast(d16, hn::LoadU(d, scratch.down() + plane));
    const auto w11 = hn::ShiftRight<8>(hn::Mul(right, down));
    const auto w01 = hn::Sub(right, w11), w10 = hn::Sub(down, w11);
    const auto w00 = hn::Sub(hn::Sub(one, right), w10);
    // Weights sum to 256: the sums just fit 16 bits.
    const auto mean = [&](auto channel) HWY_ATTR {
      const auto above =
          hn::Add(hn::Mul(channel(upper_left), w00), hn::Mul(channel(upper_right), w01));
      const auto below =
          hn::Add(hn::Mul(channel(lower_left), w10), hn::Mul(channel(lower_right), w11));
      return hn::BitCast(d, hn::ShiftRight<8 - kCodeBits>(hn::Add(above, below)));
    };
    hn::StoreU(mean(red_blue), d, out.red_blue + plane);
    hn::StoreU(mean(green), d, out.green + plane);
  }
}

/// |a - b| of unsigned 16-bit halves.
template <class D, class V>
HWY_INLINE V difference(D d, V a, V b) {
  const hn::Repartition<std::uint16_t, D> d16;
  const auto x = hn::BitCast(d16, a), y = hn::BitCast(d16, b);
  return hn::BitCast(d, hn::Or(hn::SaturatedSub(x, y), hn::SaturatedSub(y, x)));
}

/// `kAllSeen`: every camera sees every plane's point.
template <bool kAllSeen>
HWY_INLINE void compare(const CostRun& run, CostScratch& scratch, std::uint8_t* costs) {
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
  const auto seen_only = [&](auto value, const std::uint32_t* seen) HWY_ATTR {
    return kAllSeen ? value : hn::And(value, hn::LoadU(d, seen));
  };
  auto n = hn::Set(df, static_cast<float>(cameras));
  auto per_camera = hn::Div(hn::Set(df, 1.0F), hn::Max(n, two));
  for (int plane = 0; plane < run.planes.count; plane += lanes) {
    auto red_blue = hn::Zero(d), green = hn::Zero(d), count = hn::Zero(d);
    for (int i = 0; i < cameras; ++i) {
      const CostScratch::Camera camera = scratch.camera(i);
      const std::uint32_t* seen = camera.seen + plane;
      red_blue = add16(red_blue, seen_only(hn::LoadU(d, camera.red_blue + plane), seen));
      green = add16(green, seen_only(hn::LoadU(d, camera.green + plane), seen));
      if (!kAllSeen) count = hn::Sub(count, hn::LoadU(d, seen));  // -1 where it sees
    }
    if (!kAllSeen) {
      n = hn::ConvertTo(df, hn::BitCast(di, count));
      per_camera = hn::Div(hn::Set(df, 1.0F), hn::Max(n, two));
    }
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
      sum = hn::Add(sum, seen_only(hn::Min(all, truncation), camera.seen + plane));
    }
    const auto cost = hn::Mul(hn::Mul(hn::ConvertTo(df, hn::BitCast(di, sum)), scale), per_camera);
    const auto known = hn::IfThenElse(hn::Ge(n, two), cost, unknown);
    hn::StoreU(hn::DemoteTo(d8, hn::NearestInt(known)), d8, costs + plane);
  }
}

void fill(const CostRun& run, CostScratch& scratch) {
  const int stride = plane_stride(run.planes.count);
  for (int x = run.begin; x < run.end; ++x) {
    bool all_seen = true;
    for (std::size_t i = 0; i < run.cameras.size(); ++i) {
      const CostScratch::Camera out = scratch.camera(static_cast<int>(i));
      all_seen &= find_positions(*run.cameras[i], run, x, scratch, out.seen);
      gather(*run.cameras[i], run.planes.count, scratch);
      interpolate(run.planes.count, scratch, out);
    }
    std::uint8_t* costs = run.costs + static_cast<std::ptrdiff_t>(x - run.begin) * stride;
    if (all_seen) {
      compare<true>(run, scratch, costs);
    } else {
      compare<false>(run, scratch, costs);
    }
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
