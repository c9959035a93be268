// SPDX-License-Identifier: Apache-2.0
// Kernels of the focal plane reconstruction (thesis 4.1.2), for a run of pixels within one triangle
// of cameras. They compute barycentric weights, positions in the three cameras by a homography each
// and their lens models, and the weighted sum of bilinear samples in linear light. Cost: O(pixels x
// 3). Must match focal_plane_reference.cpp.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <iterator>
#include <limits>

#include "render/sampling/source_view.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sampling/source_view_kernels.cpp"
// The order of these includes matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/run-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Does what RayCells::nearest() does, for n pixels.
void keep_nearest(const std::array<double, 3>& edge_products, int n, Weights& weights) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto product = [&](std::size_t i) {
    return hn::Set(d, static_cast<float>(edge_products[i]));
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
    // Rays that cross no cell keep no weight.
    const auto sum =
        hn::Add(hn::Load(d, weights.camera[0] + i), hn::Mul(hn::Set(d, 0.5F), hn::Add(w1, w2)));
    const auto all = hn::IfThenElseZero(hn::Gt(sum, zero), one);
    hn::Store(hn::IfThenElseZero(is_first, all), d, weights.camera[0] + i);
    hn::Store(hn::IfThenElseZero(is_second, all), d, weights.camera[1] + i);
    hn::Store(hn::IfThenElseZero(is_third, all), d, weights.camera[2] + i);
  }
}

/// Processes the run's chunk of n pixels from `begin` on. `along`: see inverse_depth().
void sample_cameras(const PixelRun& run, int begin, int n, Ramp along, float* sums) {
  Weights weights;
  Taps taps[3];
  compute_weights(run, begin, n, weights);
  if (run.nearest_only) keep_nearest(run.edge_products, n, weights);
  if (!run.at_infinity) clear_missed_rays(along, n, weights);
  const SourceView* sources[3];
  int count = 0;
  for (int c = 0; c < run.count; ++c) {
    if (run.source[c]->rgba == nullptr) continue;  // sees nothing of this view
    compute_taps(*run.source[c], begin, run.y, n, weights.camera[c], taps[count]);
    prefetch_taps(*run.source[c], taps[count], n);
    sources[count++] = run.source[c];
  }
  add_samples<true>(sources, taps, count, n, sums);
}

void blend(const PixelRun& run, store::BlendSpace space, float full_scale, float* rgba,
           float* alpha, float* z, SumStage mode) {
  HWY_ALIGN float sums[4 * kChunk];
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    const std::size_t at = static_cast<std::size_t>(begin - run.begin);
    // 1 / depth, positive where the ray meets the focal plane.
    const Ramp along = inverse_depth(run.slope, run.distance, begin, run.y, n);
    if (mode == SumStage::kFinishOnly) {
      load_sums(rgba + 4 * at, n, sums);
    } else {
      sample_cameras(run, begin, n, along, sums);
    }
    if (mode == SumStage::kSampleOnly) {
      store_sums(sums, nullptr, n, rgba + 4 * at);
      continue;
    }
    // Given sums to the right of the run belong to another run.
    const int room_end = mode == SumStage::kFinishOnly ? run.end : std::max(run.end, run.room_end);
    write_pixels(sums, nullptr, nullptr, n, room_end - begin, space, full_scale, along,
                 run.at_infinity, rgba + 4 * at, alpha + at, z + at);
  }
}

void codes(const PixelRun& run, std::uint16_t* rgba) {
  Weights weights;
  Taps taps[3];
  HWY_ALIGN float sums[4 * kChunk];
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    compute_weights(run, begin, n, weights);
    if (!run.at_infinity) {
      clear_missed_rays(inverse_depth(run.slope, run.distance, begin, run.y, n), n, weights);
    }
    const SourceView* sources[3];
    int count = 0;
    for (int c = 0; c < run.count; ++c) {
      if (run.source[c]->rgba == nullptr) continue;  // sees nothing of this view
      compute_taps(*run.source[c], begin, run.y, n, weights.camera[c], taps[count]);
      sources[count++] = run.source[c];
    }
    add_samples<true>(sources, taps, count, n, sums);
    const hn::FixedTag<float, 4> d;
    const hn::RebindToSigned<decltype(d)> d32;
    const hn::Rebind<std::uint16_t, decltype(d)> d16;
    for (int i = 0; i < n; ++i) {
      const float* pixel = sums + 4 * transposed_index(hn::ScalableTag<float>(), i);
      const auto rounded = hn::ConvertTo(d32, hn::Add(hn::Load(d, pixel), hn::Set(d, 0.5F)));
      hn::StoreU(hn::DemoteTo(d16, rounded), d16,
                 rgba + static_cast<std::size_t>(begin - run.begin + i) * 4);
    }
  }
}

/// Marks the MCUs that a tap reads, chroma included.
void mark_mcus(const SourceView& source, const Taps& taps, int n) {
  const auto column_of = [&](int x) { return x >> source.mcu_width_log2; };
  const auto row_of = [&](int y) { return (y >> source.mcu_height_log2) * source.mcus_per_row; };
  int last[2] = {-1, -1};  // of the previous pixel: mostly the same
  for (int i = 0; i < n; ++i) {
    if (!(taps.share[i] > 0)) continue;
    const int x = taps.pixel[i] % source.width, y = taps.pixel[i] / source.width;
    const int left = column_of(std::max(x - source.chroma_radius, 0));
    const int right = column_of(std::min(x + 1 + source.chroma_radius, source.width - 1));
    const int upper = row_of(std::max(y - source.chroma_radius, 0));
    const int lower = row_of(std::min(y + 1 + source.chroma_radius, source.height - 1));
    if (upper + left == last[0] && lower + right == last[1]) continue;
    last[0] = upper + left;
    last[1] = lower + right;
    for (const int mcu : {upper + left, upper + right, lower + left, lower + right}) {
      mark_mcu(source.wanted_mcus, mcu);
    }
  }
}

void mark(const PixelRun& run) {
  Weights weights;
  Taps taps;
  for (int begin = run.begin; begin < run.end; begin += kChunk) {
    const int n = std::min(kChunk, run.end - begin);
    compute_weights(run, begin, n, weights);
    if (run.nearest_only) keep_nearest(run.edge_products, n, weights);
    if (!run.at_infinity) {
      clear_missed_rays(inverse_depth(run.slope, run.distance, begin, run.y, n), n, weights);
    }
    for (int c = 0; c < run.count; ++c) {
      const SourceView& source = *run.source[c];
      if (source.wanted_mcus == nullptr && source.read_pixels == nullptr) continue;
      compute_taps(source, begin, run.y, n, weights.camera[c], taps);
      if (source.wanted_mcus != nullptr) mark_mcus(source, taps, n);
      if (source.read_pixels != nullptr) mark_pixels(source, taps, n);
    }
  }
}

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(mark);
HWY_EXPORT(blend);
HWY_EXPORT(codes);
HWY_EXPORT(target);

void mark_run(const PixelRun& run) { HWY_DYNAMIC_DISPATCH(mark)(run); }
void blend_run(const PixelRun& run, store::BlendSpace space, float full_scale, float* rgba,
               float* alpha, float* z, SumStage sums) {
  HWY_DYNAMIC_DISPATCH(blend)(run, space, full_scale, rgba, alpha, z, sums);
}
void blend_run_codes(const PixelRun& run, std::uint16_t* rgba) {
  HWY_DYNAMIC_DISPATCH(codes)(run, rgba);
}
const char* kernel_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage::render
#endif
