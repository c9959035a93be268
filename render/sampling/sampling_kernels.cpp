// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "render/sampling/source_view.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sampling/sampling_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/finish-inl.h"
#include "render/sampling/lens-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Pixels worked on at once: positions are vectors across them, then samples vectors across colour.
constexpr int kChunk = 64;

/// Where a camera is sampled for each pixel of a chunk: the upper left of four neighbours, and the
/// four weights (interpolation times the camera's share of the ray).
struct Taps {
  HWY_ALIGN std::int32_t x[kChunk], y[kChunk];
  HWY_ALIGN float weight00[kChunk], weight10[kChunk], weight01[kChunk], weight11[kChunk];
};

struct Weights {
  HWY_ALIGN float camera[3][kChunk];
};

/// A linear function of the pixel, from the chunk's first pixel on: the base in double, the short
/// way from there in float.
struct Ramp {
  float base, step;
};
Ramp ramp(const double* function, int x, int y, double scale) {
  return {static_cast<float>((function[0] * (x + 0.5) + (function[1] * (y + 0.5) + function[2])) *
                             scale),
          static_cast<float>(function[0] * scale)};
}

template <class D>
hn::Vec<D> values(D d, Ramp r, hn::Vec<D> steps) {
  return hn::MulAdd(steps, hn::Set(d, r.step), hn::Set(d, r.base));
}

void find_weights(const PixelRun& run, int begin, int n, Weights& weights) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const double middle = begin + 0.5 * n;
  const double total = run.total[0] * middle + (run.total[1] * (run.y + 0.5) + run.total[2]);
  const double scale = 1 / total;  // keeps the shares near 1 whatever the distance to the array
  Ramp shares[3] = {};
  for (int c = 0; c < run.count; ++c) shares[c] = ramp(run.share[c].data(), begin, run.y, scale);
  for (int i = 0; i < n; i += lanes) {
    const auto steps = hn::Iota(d, static_cast<float>(i));
    const auto zero = hn::Zero(d);
    const auto w0 = hn::Max(values(d, shares[0], steps), zero);
    const auto w1 = hn::Max(values(d, shares[1], steps), zero);
    const auto w2 = hn::Max(values(d, shares[2], steps), zero);
    const auto sum = hn::Add(w0, hn::Add(w1, w2));
    const auto inverse = hn::IfThenElseZero(hn::Gt(sum, zero), hn::Div(hn::Set(d, 1.0F), sum));
    hn::Store(hn::Mul(w0, inverse), d, weights.camera[0] + i);
    hn::Store(hn::Mul(w1, inverse), d, weights.camera[1] + i);
    hn::Store(hn::Mul(w2, inverse), d, weights.camera[2] + i);
  }
}

/// RayCells::nearest().
void keep_nearest(const std::array<double, 3>& corner_products, int n, Weights& weights) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto product = [&](std::size_t i) {
    return hn::Set(d, static_cast<float>(corner_products[i]));
  };
  const auto to_second = product(0), between = product(1), to_third = product(2);
  const auto two = hn::Set(d, 2.0F), one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  for (int i = 0; i < n; i += lanes) {
    const auto w1 = hn::Mul(two, hn::Load(d, weights.camera[1] + i));
    const auto w2 = hn::Mul(two, hn::Load(d, weights.camera[2] + i));
    const auto second = hn::Sub(hn::MulAdd(w1, to_second, hn::Mul(w2, between)), to_second);
    const auto third = hn::Sub(hn::MulAdd(w1, between, hn::Mul(w2, to_third)), to_third);
    const auto is_first = hn::And(hn::Le(second, zero), hn::Le(third, zero));
    const auto is_second = hn::AndNot(is_first, hn::Ge(second, third));
    const auto is_third = hn::Not(hn::Or(is_first, is_second));
    // A ray that passes no cell has no weight to give away.
    const auto sum =
        hn::Add(hn::Load(d, weights.camera[0] + i), hn::Mul(hn::Set(d, 0.5F), hn::Add(w1, w2)));
    const auto all = hn::IfThenElseZero(hn::Gt(sum, zero), one);
    hn::Store(hn::IfThenElseZero(is_first, all), d, weights.camera[0] + i);
    hn::Store(hn::IfThenElseZero(is_second, all), d, weights.camera[1] + i);
    hn::Store(hn::IfThenElseZero(is_third, all), d, weights.camera[2] + i);
  }
}

void find_taps(const SourceView& source, int begin, int y, int n, const float* share, Taps& taps) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const double* m = source.ideal_from_pixel.data();
  // Common scale of (X, Y, W): only their ratio matters, and float must hold them.
  const double w_here = m[6] * (begin + 0.5) + (m[7] * (y + 0.5) + m[8]);
  const double scale = w_here != 0 ? 1 / std::abs(w_here) : 1;
  const Ramp ramp_x = ramp(m, begin, y, scale);
  const Ramp ramp_y = ramp(m + 3, begin, y, scale);
  const Ramp ramp_w = ramp(m + 6, begin, y, scale);
  const auto set = [&](float value) { return hn::Set(d, value); };
  const auto one = set(1), zero = hn::Zero(d), half = set(0.5F);
  const auto width = set(static_cast<float>(source.width));
  const auto height = set(static_cast<float>(source.height));

  for (int i = 0; i < n; i += lanes) {
    const auto steps = hn::Iota(d, static_cast<float>(i));
    const auto w = values(d, ramp_w, steps);
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    const auto x_ideal = hn::Mul(values(d, ramp_x, steps), inverse);
    const auto y_ideal = hn::Mul(values(d, ramp_y, steps), inverse);
    const auto sight = through_lens(d, source, x_ideal, y_ideal, in_front);
    const auto weight = hn::Mul(sight.seen, hn::Load(d, share + i));
    const auto left = hn::Min(hn::Max(hn::Sub(sight.u, half), zero), hn::Sub(width, one));
    const auto top = hn::Min(hn::Max(hn::Sub(sight.v, half), zero), hn::Sub(height, one));
    const auto x0 = hn::Floor(left), y0 = hn::Floor(top);
    const auto right_part = hn::Sub(left, x0), lower_part = hn::Sub(top, y0);
    const auto lower = hn::Mul(weight, lower_part), upper = hn::Sub(weight, lower);
    const auto weight11 = hn::Mul(lower, right_part), weight01 = hn::Mul(upper, right_part);
    hn::Store(hn::ConvertTo(di, x0), di, taps.x + i);
    hn::Store(hn::ConvertTo(di, y0), di, taps.y + i);
    hn::Store(hn::Sub(upper, weight01), d, taps.weight00 + i);
    hn::Store(weight01, d, taps.weight01 + i);
    hn::Store(hn::Sub(lower, weight11), d, taps.weight10 + i);
    hn::Store(weight11, d, taps.weight11 + i);
  }
}

/// Adds the four neighbours of each tap; `accumulator`: 4 floats a pixel.
void add_samples(const SourceView& source, const Taps& taps, int n, bool first,
                 float* HWY_RESTRICT accumulator) {
  const hn::FixedTag<float, 4> d;
  const hn::Rebind<std::uint16_t, decltype(d)> d16;
  const hn::Rebind<std::int32_t, decltype(d)> d32;
  const auto pixel = [&](const std::uint16_t* at) {
    return hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, at)));
  };
  const std::size_t row = static_cast<std::size_t>(source.width) * 4;
  for (int i = 0; i < n; ++i) {
    const std::uint16_t* upper = source.rgbx + static_cast<std::size_t>(taps.y[i]) * row +
                                 static_cast<std::size_t>(taps.x[i]) * 4;
    const std::uint16_t* lower = upper + row;
    auto sum = first ? hn::Zero(d) : hn::Load(d, accumulator + 4 * i);
    sum = hn::MulAdd(hn::Set(d, taps.weight00[i]), pixel(upper), sum);
    sum = hn::MulAdd(hn::Set(d, taps.weight01[i]), pixel(upper + 4), sum);
    sum = hn::MulAdd(hn::Set(d, taps.weight10[i]), pixel(lower), sum);
    sum = hn::MulAdd(hn::Set(d, taps.weight11[i]), pixel(lower + 4), sum);
    hn::Store(sum, d, accumulator + 4 * i);
  }
}

void blend(const PixelRun& run, BlendSpace space, float full_scale, float* rgba, float* z) {
  Weights weights;
  Taps taps;
  HWY_ALIGN float sums[4 * kChunk];
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    find_weights(run, begin, n, weights);
    if (run.nearest_only) keep_nearest(run.corner_products, n, weights);
    bool first = true;
    for (int c = 0; c < run.count; ++c) {
      const SourceView& source = *run.source[c];
      if (source.rgbx == nullptr) continue;  // sees nothing of this view
      find_taps(source, begin, run.y, n, weights.camera[c], taps);
      add_samples(source, taps, n, first, sums);
      first = false;
    }
    if (first) std::fill(sums, sums + 4 * n, 0.0F);
    float* out_z = z + (begin - run.begin);
    const Ramp along = ramp(run.slope.data(), begin, run.y, 1 / run.distance);
    for (int i = 0; i < n; ++i) {
      const float slope = along.base + static_cast<float>(i) * along.step;
      const bool met = run.at_infinity || slope > 0;
      if (!met) std::fill(sums + 4 * i, sums + 4 * i + 4, 0.0F);
      out_z[i] = !run.at_infinity && sums[4 * i + 3] > 0 ? 1 / slope
                                                         : std::numeric_limits<float>::infinity();
    }
    finish(sums, n, space, full_scale, rgba + static_cast<std::size_t>(begin - run.begin) * 4);
  }
}

void codes(const PixelRun& run, std::uint16_t* rgba) {
  Weights weights;
  Taps taps;
  HWY_ALIGN float sums[4 * kChunk];
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    find_weights(run, begin, n, weights);
    for (int c = 0; c < run.count; ++c) {
      find_taps(*run.source[c], begin, run.y, n, weights.camera[c], taps);
      add_samples(*run.source[c], taps, n, c == 0, sums);
    }
    const Ramp along = ramp(run.slope.data(), begin, run.y, run.at_infinity ? 1 : 1 / run.distance);
    const hn::FixedTag<float, 4> d;
    const hn::RebindToSigned<decltype(d)> d32;
    const hn::Rebind<std::uint16_t, decltype(d)> d16;
    for (int i = 0; i < n; ++i) {
      const bool met = run.at_infinity || along.base + static_cast<float>(i) * along.step > 0;
      const auto sum = hn::Add(hn::Load(d, sums + 4 * i), hn::Set(d, 0.5F));
      const auto code = hn::DemoteTo(d16, hn::ConvertTo(d32, met ? sum : hn::Zero(d)));
      hn::StoreU(code, d16, rgba + static_cast<std::size_t>(begin - run.begin + i) * 4);
    }
  }
}

/// First and last MCU of what each tap reads, chroma included; -1 for taps that count for nothing.
struct TapMcus {
  HWY_ALIGN std::int32_t first[kChunk], last[kChunk], other[kChunk];
};

void find_mcus(const SourceView& source, const Taps& taps, int n, TapMcus& mcus) {
  const hn::ScalableTag<std::int32_t> d;
  const hn::Rebind<float, decltype(d)> df;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto set = [&](int value) { return hn::Set(d, value); };
  const auto reach = set(source.chroma_reach), next = set(1 + source.chroma_reach);
  const auto per_row = set(source.mcus_per_row), zero = hn::Zero(d);
  for (int i = 0; i < n; i += lanes) {
    const auto x = hn::Load(d, taps.x + i), y = hn::Load(d, taps.y + i);
    const auto left = hn::ShiftRightSame(hn::Max(hn::Sub(x, reach), zero), source.mcu_width_log2);
    const auto right =
        hn::ShiftRightSame(hn::Min(hn::Add(x, next), set(source.width - 1)), source.mcu_width_log2);
    const auto upper = hn::Mul(
        hn::ShiftRightSame(hn::Max(hn::Sub(y, reach), zero), source.mcu_height_log2), per_row);
    const auto lower = hn::Mul(hn::ShiftRightSame(hn::Min(hn::Add(y, next), set(source.height - 1)),
                                                  source.mcu_height_log2),
                               per_row);
    const auto weight =
        hn::Add(hn::Add(hn::Load(df, taps.weight00 + i), hn::Load(df, taps.weight01 + i)),
                hn::Add(hn::Load(df, taps.weight10 + i), hn::Load(df, taps.weight11 + i)));
    const auto counts = hn::RebindMask(d, hn::Gt(weight, hn::Zero(df)));
    const auto none = set(-1);
    hn::Store(hn::IfThenElse(counts, hn::Add(upper, left), none), d, mcus.first + i);
    hn::Store(hn::IfThenElse(counts, hn::Add(lower, right), none), d, mcus.last + i);
    hn::Store(hn::IfThenElse(counts, hn::Add(upper, right), none), d, mcus.other + i);
  }
}

void mark_mcus(const SourceView& source, const Taps& taps, int n) {
  TapMcus mcus;
  find_mcus(source, taps, n, mcus);
  int first = -1, last = -1;  // of the tap before, which is nearly always the same
  for (int i = 0; i < n; ++i) {
    if (mcus.first[i] == first && mcus.last[i] == last) continue;
    first = mcus.first[i];
    last = mcus.last[i];
    if (first < 0) continue;
    source.wanted_mcus[first] = 1;
    source.wanted_mcus[last] = 1;
    source.wanted_mcus[mcus.other[i]] = 1;
    source.wanted_mcus[first + last - mcus.other[i]] = 1;
  }
}

void mark_pixels(const SourceView& source, const Taps& taps, int n) {
  for (int i = 0; i < n; ++i) {
    std::uint8_t* at =
        source.read_pixels +
        static_cast<std::size_t>(taps.y[i]) * static_cast<std::size_t>(source.width) +
        static_cast<std::size_t>(taps.x[i]);
    if (taps.weight00[i] > 0) at[0] = 1;
    if (taps.weight01[i] > 0) at[1] = 1;
    if (taps.weight10[i] > 0) at[source.width] = 1;
    if (taps.weight11[i] > 0) at[source.width + 1] = 1;
  }
}

void mark(const PixelRun& run) {
  Weights weights;
  Taps taps;
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    find_weights(run, begin, n, weights);
    if (run.nearest_only) keep_nearest(run.corner_products, n, weights);
    const Ramp along = ramp(run.slope.data(), begin, run.y, 1 / run.distance);
    if (!run.at_infinity) {
      for (int i = 0; i < n; ++i) {  // rays that never meet the plane want nothing
        if (along.base + static_cast<float>(i) * along.step > 0) continue;
        for (auto& camera : weights.camera) camera[i] = 0;
      }
    }
    for (int c = 0; c < run.count; ++c) {
      const SourceView& source = *run.source[c];
      if (source.wanted_mcus == nullptr) continue;
      find_taps(source, begin, run.y, n, weights.camera[c], taps);
      mark_mcus(source, taps, n);
      if (source.read_pixels != nullptr) mark_pixels(source, taps, n);
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

HWY_EXPORT(mark);
HWY_EXPORT(blend);
HWY_EXPORT(codes);
HWY_EXPORT(target);

void mark_run(const PixelRun& run) { HWY_DYNAMIC_DISPATCH(mark)(run); }
void blend_run(const PixelRun& run, BlendSpace space, float full_scale, float* rgba, float* z) {
  HWY_DYNAMIC_DISPATCH(blend)(run, space, full_scale, rgba, z);
}
void codes_of_run(const PixelRun& run, std::uint16_t* rgba) {
  HWY_DYNAMIC_DISPATCH(codes)(run, rgba);
}
const char* kernel_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage
#endif
