// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <limits>

#include "render/sampling/aperture_run.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sampling/aperture_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/run-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Where the rays of a chunk cross the array, and what the weights of the cameras there sum to.
struct Crossings {
  HWY_ALIGN float x[kChunk], y[kChunk];
  HWY_ALIGN float present[kChunk], absent[kChunk];
};

void find_crossings(const ApertureRun& run, int begin, int n, Weights& weights,
                    Crossings& crossings) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  find_weights(run.cell, begin, n, weights);
  const auto sum = [&](std::size_t axis, int i) HWY_ATTR {
    auto total = hn::Zero(d);
    for (std::size_t c = 0; c < 3; ++c) {
      total =
          hn::MulAdd(hn::Load(d, weights.camera[c] + i), hn::Set(d, run.corner[c][axis]), total);
    }
    return total;
  };
  for (int i = 0; i < n; i += lanes) {
    hn::Store(sum(0, i), d, crossings.x + i);
    hn::Store(sum(1, i), d, crossings.y + i);
    hn::Store(hn::Zero(d), d, crossings.present + i);
    hn::Store(hn::Zero(d), d, crossings.absent + i);
  }
}

/// A camera's weight for each ray, added to the sums; false where it has none.
HWY_INLINE bool find_aperture_weights(const ApertureCamera& camera, const ApertureShape& shape,
                                      int n, Crossings& crossings, float* weight) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0F);
  const auto scale = hn::Set(d, camera.inverse_reach);
  const auto x = hn::Set(d, -camera.x * camera.inverse_reach);
  const auto y = hn::Set(d, -camera.y * camera.inverse_reach);
  const auto steepness = hn::Set(d, shape.steepness);
  float* sum = camera.present ? crossings.present : crossings.absent;
  auto largest = zero;
  for (int i = 0; i < n; i += lanes) {
    const auto right = hn::MulAdd(hn::Load(d, crossings.x + i), scale, x);
    const auto up = hn::MulAdd(hn::Load(d, crossings.y + i), scale, y);
    auto q_squared = hn::MulAdd(right, right, hn::Mul(up, up));
    if (!shape.sides.empty()) {
      auto q = zero;
      for (const auto& side : shape.sides) {
        const auto along = hn::MulAdd(right, hn::Set(d, side[0]), hn::Mul(up, hn::Set(d, side[1])));
        q = hn::Max(q, hn::Abs(along));
      }
      q_squared = hn::Mul(q, q);
    }
    const auto t = hn::Min(one, hn::Max(zero, hn::NegMulAdd(q_squared, steepness, steepness)));
    const auto f = hn::Mul(hn::Mul(t, t), hn::NegMulAdd(hn::Set(d, 2.0F), t, hn::Set(d, 3.0F)));
    hn::Store(f, d, weight + i);
    largest = hn::Max(largest, f);
    hn::Store(hn::Add(f, hn::Load(d, sum + i)), d, sum + i);
  }
  return !hn::AllFalse(d, hn::Gt(largest, zero));
}

/// Where the camera is read for the chunk from pixel `begin` on.
void find_taps_of(const ApertureRun& run, const ApertureCamera& camera, int begin, int n,
                  const float* weight, Taps& taps) {
  if (run.inverse_depth == nullptr) {
    find_taps(*camera.source, begin, run.cell.y, n, weight, taps);
  } else {
    find_taps_at_depth(*camera.source, camera.per_inverse_depth.data(), begin, run.cell.y, n,
                       run.inverse_depth + (begin - run.cell.begin), weight, taps);
  }
}

/// The depths of pixels with depths of their own; +infinity where nothing is seen.
void write_depths(const float* inverse_depth, const float* alpha, int n, float* z) {
  for (int i = 0; i < n; ++i) {
    z[i] = alpha[i] > 0 ? 1 / inverse_depth[i] : std::numeric_limits<float>::infinity();
  }
}

/// Sums of weights become what sums of samples are multiplied by (`present`), and the part that
/// cameras present have in all (`absent`).
void find_shares(bool at_infinity, Ramp along, int n, Crossings& crossings) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto least = hn::Set(d, 1e-30F), zero = hn::Zero(d);
  for (int i = 0; i < n; i += lanes) {
    const auto present = hn::Load(d, crossings.present + i);
    const auto complete = hn::Add(present, hn::Load(d, crossings.absent + i));
    auto counts = hn::Gt(present, least);
    if (!at_infinity) {  // rays that never meet the focal plane count for nothing
      const auto slope = values(d, along, counting_from(d, i - along.start));
      counts = hn::And(counts, hn::Gt(slope, zero));
    }
    hn::Store(hn::IfThenElseZero(counts, reciprocal(d, present)), d, crossings.present + i);
    hn::Store(hn::IfThenElseZero(counts, hn::Mul(present, reciprocal(d, complete))), d,
              crossings.absent + i);
  }
}

void blend_aperture(const ApertureRun& run, BlendSpace space, float full_scale, float* rgba,
                    float* coverage, float* z) {
  constexpr int kTogether = 3;
  Weights weights;
  Crossings crossings;
  Taps taps[kTogether];
  HWY_ALIGN float sums[4 * kChunk];
  HWY_ALIGN float weight[kChunk];
  const PixelRun& cell = run.cell;
  for (int begin = cell.begin; begin < cell.end; begin += kChunk) {
    const int n = std::min(kChunk, cell.end - begin);
    const Ramp along = inverse_depth(cell.slope, cell.distance, begin, cell.y, n);
    find_crossings(run, begin, n, weights, crossings);
    const SourceView* sources[kTogether];
    int waiting = 0;
    bool first = true;
    const auto add_waiting = [&]() HWY_ATTR {
      if (first) {
        add_samples<true>(sources, taps, waiting, n, sums);
      } else {
        add_samples<false>(sources, taps, waiting, n, sums);
      }
      first = false;
      waiting = 0;
    };
    for (const ApertureCamera& camera : run.cameras) {
      if (!find_aperture_weights(camera, run.shape, n, crossings, weight)) continue;
      if (!camera.present || camera.source->rgbx == nullptr) continue;
      find_taps_of(run, camera, begin, n, weight, taps[waiting]);
      prefetch_taps(*camera.source, taps[waiting], n);
      sources[waiting++] = camera.source;
      if (waiting == kTogether) add_waiting();
    }
    if (waiting > 0 || first) add_waiting();
    find_shares(cell.at_infinity, along, n, crossings);
    const std::size_t at = static_cast<std::size_t>(begin - cell.begin);
    write_pixels(sums, crossings.present, crossings.absent, n,
                 std::max(cell.end, cell.room_end) - begin, space, full_scale, along,
                 cell.at_infinity, rgba + 4 * at, coverage + at, z + at);
    if (run.inverse_depth != nullptr) {
      write_depths(run.inverse_depth + at, coverage + at, n, z + at);
    }
  }
}

void mark_aperture(const ApertureRun& run) {
  Weights weights;
  Crossings crossings;
  Taps taps;
  HWY_ALIGN float weight[kChunk];
  const PixelRun& cell = run.cell;
  for (int begin = cell.begin; begin < cell.end; begin += kChunk) {
    const int n = std::min(kChunk, cell.end - begin);
    find_crossings(run, begin, n, weights, crossings);
    for (const ApertureCamera& camera : run.cameras) {
      if (!camera.present || camera.source->read_pixels == nullptr) continue;
      if (!find_aperture_weights(camera, run.shape, n, crossings, weight)) continue;
      if (!cell.at_infinity) {
        const Ramp along = inverse_depth(cell.slope, cell.distance, begin, cell.y, n);
        for (int i = 0; i < n; ++i) {
          if (!(along.base + static_cast<float>(i - along.start) * along.step > 0)) weight[i] = 0;
        }
      }
      find_taps_of(run, camera, begin, n, weight, taps);
      mark_pixels(*camera.source, taps, n);
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage {

HWY_EXPORT(mark_aperture);
HWY_EXPORT(blend_aperture);

void mark_pixels_of_aperture(const ApertureRun& run) { HWY_DYNAMIC_DISPATCH(mark_aperture)(run); }
void blend_aperture_run(const ApertureRun& run, BlendSpace space, float full_scale, float* rgba,
                        float* coverage, float* z) {
  HWY_DYNAMIC_DISPATCH(blend_aperture)(run, space, full_scale, rgba, coverage, z);
}

}  // namespace raystage
#endif
