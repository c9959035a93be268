// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <iterator>
#include <limits>

#include "render/sampling/source_view.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sampling/sampling_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/finish-inl.h"
#include "render/sampling/taps-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

struct Weights {
  HWY_ALIGN float camera[3][kChunk];
};

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
    const auto inverse = hn::IfThenElseZero(hn::Gt(sum, hn::Set(d, 1e-30F)), reciprocal(d, sum));
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

/// Rays that never meet the focal plane have no weight to give. `along`: see blend().
void drop_unmet(Ramp along, int n, Weights& weights) {
  if (along.base > 0 && along.base + static_cast<float>(n - 1) * along.step > 0) return;
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < n; i += lanes) {
    const auto met = hn::Gt(values(d, along, hn::Iota(d, static_cast<float>(i))), hn::Zero(d));
    for (auto& camera : weights.camera) {
      hn::Store(hn::IfThenElseZero(met, hn::Load(d, camera + i)), d, camera + i);
    }
  }
}

/// Sums the samples of kCount cameras, in whole vectors of pixels; `sums`: 4 floats a pixel, in the
/// order of transpose_blocks().
template <int kCount>
void sum_samples(const SourceView* const* sources, const Taps* taps, int n, float* sums) {
  const SumTag d;
  const int lanes = static_cast<int>(hn::Lanes(hn::ScalableTag<float>()));
  const std::uint16_t* frame[kCount];
  std::size_t row[kCount];
  for (int c = 0; c < kCount; ++c) {
    frame[c] = sources[c]->rgbx;
    row[c] = std::size_t{4} * static_cast<std::size_t>(sources[c]->width);
  }
  for (int begin = 0; begin < n; begin += lanes) {
    int slot = begin;
    for (int first = begin; first < begin + 4; ++first) {
      for (int i = first; i < begin + lanes; i += 4, ++slot) {
        auto sum = hn::Zero(d);
        for (int c = 0; c < kCount; ++c) {
          sum = add_tap(frame[c], row[c], taps[c].pixel[i], taps[c].weight + 4 * slot, sum);
        }
        hn::Store(fold(sum), hn::FixedTag<float, 4>(), sums + 4 * slot);
      }
    }
  }
}

/// A vector of the view's pixels.
struct Pixels {
  HWY_ALIGN float rgba[4 * hn::MaxLanes(hn::ScalableTag<float>())];
  HWY_ALIGN float alpha[hn::MaxLanes(hn::ScalableTag<float>())];
  HWY_ALIGN float z[hn::MaxLanes(hn::ScalableTag<float>())];
};

/// From sums in the order of transpose_blocks() to the view, of which `room` pixels may be written.
/// `along`: 1 / planar depth.
void write_pixels(const float* sums, int n, int room, BlendSpace space, float full_scale,
                  Ramp along, bool at_infinity, float* rgba, float* alpha, float* z) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto infinity = hn::Set(d, std::numeric_limits<float>::infinity());
  for (int i = 0; i < n; i += lanes) {
    const float* from = sums + 4 * i;
    auto r = hn::Load(d, from), g = hn::Load(d, from + lanes);
    auto b = hn::Load(d, from + 2 * lanes), weight = hn::Load(d, from + 3 * lanes);
    transpose_blocks(d, r, g, b, weight);
    finish(d, space, full_scale, r, g, b, weight);
    auto depth = infinity;
    if (!at_infinity) {
      const auto steps = hn::Iota(d, static_cast<float>(i));
      const auto slope = values(d, along, steps);
      const auto seen = hn::And(hn::Gt(weight, hn::Zero(d)), hn::Gt(slope, hn::Set(d, 1e-30F)));
      depth = hn::IfThenElse(seen, reciprocal(d, slope), infinity);
    }
    if (i + lanes <= room) {
      hn::StoreInterleaved4(r, g, b, weight, d, rgba + 4 * i);
      hn::StoreU(weight, d, alpha + i);
      hn::StoreU(depth, d, z + i);
    } else {
      Pixels last;
      hn::StoreInterleaved4(r, g, b, weight, d, last.rgba);
      hn::Store(weight, d, last.alpha);
      hn::Store(depth, d, last.z);
      std::copy_n(last.rgba, 4 * (n - i), rgba + 4 * i);
      std::copy_n(last.alpha, n - i, alpha + i);
      std::copy_n(last.z, n - i, z + i);
    }
  }
}

void blend(const PixelRun& run, BlendSpace space, float full_scale, float* rgba, float* alpha,
           float* z) {
  Weights weights;
  Taps taps[3];
  HWY_ALIGN float sums[4 * kChunk];
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    // Positive where the ray meets the focal plane: 1 / depth.
    const Ramp along = ramp(run.slope.data(), begin, run.y, 1 / run.distance);
    find_weights(run, begin, n, weights);
    if (run.nearest_only) keep_nearest(run.corner_products, n, weights);
    if (!run.at_infinity) drop_unmet(along, n, weights);
    const SourceView* sources[3];
    int count = 0;
    for (int c = 0; c < run.count; ++c) {
      if (run.source[c]->rgbx == nullptr) continue;  // sees nothing of this view
      find_taps(*run.source[c], begin, run.y, n, weights.camera[c], taps[count]);
      prefetch_taps(*run.source[c], taps[count], n);
      sources[count++] = run.source[c];
    }
    if (count == 3) {
      sum_samples<3>(sources, taps, n, sums);
    } else if (count == 2) {
      sum_samples<2>(sources, taps, n, sums);
    } else if (count == 1) {
      sum_samples<1>(sources, taps, n, sums);
    } else {
      std::fill(std::begin(sums), std::end(sums), 0.0F);
    }
    const std::size_t at = static_cast<std::size_t>(begin - run.begin);
    write_pixels(sums, n, std::max(run.end, run.room_end) - begin, space, full_scale, along,
                 run.at_infinity, rgba + 4 * at, alpha + at, z + at);
  }
}

/// Marks a tap's MCUs, chroma included.
void mark_mcus(const SourceView& source, const Taps& taps, int n) {
  const auto column_of = [&](int x) { return x >> source.mcu_width_log2; };
  const auto row_of = [&](int y) { return (y >> source.mcu_height_log2) * source.mcus_per_row; };
  for (int i = 0; i < n; ++i) {
    const float* weight = taps.weight + 4 * slot_of(hn::ScalableTag<float>(), i);
    if (!(weight[0] + weight[1] + weight[2] + weight[3] > 0)) continue;
    const int x = taps.pixel[i] % source.width, y = taps.pixel[i] / source.width;
    const int left = column_of(std::max(x - source.chroma_reach, 0));
    const int right = column_of(std::min(x + 1 + source.chroma_reach, source.width - 1));
    const int upper = row_of(std::max(y - source.chroma_reach, 0));
    const int lower = row_of(std::min(y + 1 + source.chroma_reach, source.height - 1));
    for (const int mcu : {upper + left, upper + right, lower + left, lower + right}) {
      std::atomic_ref(source.wanted_mcus[mcu]).store(1, std::memory_order_relaxed);
    }
  }
}

void mark_pixels(const SourceView& source, const Taps& taps, int n) {
  for (int i = 0; i < n; ++i) {
    std::uint8_t* at = source.read_pixels + taps.pixel[i];
    const float* weight = taps.weight + 4 * slot_of(hn::ScalableTag<float>(), i);
    const auto mark = [](std::uint8_t& pixel, float w) {
      if (w > 0) std::atomic_ref(pixel).store(1, std::memory_order_relaxed);
    };
    mark(at[0], weight[0]);
    mark(at[1], weight[1]);
    mark(at[source.width], weight[2]);
    mark(at[source.width + 1], weight[3]);
  }
}

void mark(const PixelRun& run) {
  Weights weights;
  Taps taps;
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    find_weights(run, begin, n, weights);
    if (run.nearest_only) keep_nearest(run.corner_products, n, weights);
    if (!run.at_infinity) {
      drop_unmet(ramp(run.slope.data(), begin, run.y, 1 / run.distance), n, weights);
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
HWY_EXPORT(target);

void mark_run(const PixelRun& run) { HWY_DYNAMIC_DISPATCH(mark)(run); }
void blend_run(const PixelRun& run, BlendSpace space, float full_scale, float* rgba, float* alpha,
               float* z) {
  HWY_DYNAMIC_DISPATCH(blend)(run, space, full_scale, rgba, alpha, z);
}
const char* kernel_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage
#endif
