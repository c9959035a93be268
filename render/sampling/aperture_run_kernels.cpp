// SPDX-License-Identifier: Apache-2.0
// Kernels of the synthetic aperture (Isaksen et al., "Dynamically reparameterized light fields",
// SIGGRAPH 2000). They compute the weights of all cameras within the aperture around a ray's
// crossing of the array. The output is the weighted mean of their samples on a plane or at given
// depths. Input: ApertureRun, one row of pixels within a cell of the array. Cost: O(pixels x
// cameras in the aperture). Must match aperture_reference.cpp.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "render/sampling/aperture_run.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sampling/aperture_run_kernels.cpp"
// The order of these includes matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/run-inl.h"
#include "render/sampling/windows-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Where a chunk's rays cross the array, and the sums of camera weights there.
struct Crossings {
  HWY_ALIGN float x[kChunk], y[kChunk];
  HWY_ALIGN float present[kChunk], absent[kChunk];
};

/// The bounding box of crossings.
struct CrossedBox {
  float left = std::numeric_limits<float>::infinity(), right = -left;
  float bottom = left, top = -left;

  /// Returns whether the camera's weight may be above 0 for some of them.
  bool is_near(const ApertureCamera& camera, const ApertureShape& shape) const {
    const float x = camera.x - std::clamp(camera.x, left, right);
    const float y = camera.y - std::clamp(camera.y, bottom, top);
    const float to_corner = shape.sides.empty() ? 1.0F : 1.4143F;  // largest: the square's
    const float reach = to_corner * (1 + 1e-5F);
    return (x * x + y * y) * camera.inverse_radius * camera.inverse_radius < reach * reach &&
           camera.height_squared < 1;
  }
};

/// Computes crossings; `box` is enlarged to contain them.
void find_crossings(const ApertureRun& run, int begin, int n, Weights& weights,
                    Crossings& crossings, CrossedBox& box) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  compute_weights(run.cell, begin, n, weights);
  const auto sum = [&](std::size_t axis, int i) HWY_ATTR {
    auto total = hn::Zero(d);
    for (std::size_t c = 0; c < 3; ++c) {
      total =
          hn::MulAdd(hn::Load(d, weights.camera[c] + i), hn::Set(d, run.corner[c][axis]), total);
    }
    return total;
  };
  auto left = hn::Set(d, box.left), right = hn::Set(d, box.right);
  auto bottom = hn::Set(d, box.bottom), top = hn::Set(d, box.top);
  for (int i = 0; i < n; i += lanes) {
    const auto x = sum(0, i), y = sum(1, i);
    left = hn::Min(left, x);
    right = hn::Max(right, x);
    bottom = hn::Min(bottom, y);
    top = hn::Max(top, y);
    hn::Store(x, d, crossings.x + i);
    hn::Store(y, d, crossings.y + i);
    hn::Store(hn::Zero(d), d, crossings.present + i);
    hn::Store(hn::Zero(d), d, crossings.absent + i);
  }
  box.left = hn::GetLane(hn::MinOfLanes(d, left));
  box.right = hn::GetLane(hn::MaxOfLanes(d, right));
  box.bottom = hn::GetLane(hn::MinOfLanes(d, bottom));
  box.top = hn::GetLane(hn::MaxOfLanes(d, top));
}

/// Returns a camera's weight for rays that cross the array at (x, y): ApertureLens has the formula.
template <class D, class V>
HWY_INLINE V aperture_weight(D d, const ApertureCamera& camera, const ApertureShape& shape, V x,
                             V y) {
  const auto scale = hn::Set(d, camera.inverse_radius), steepness = hn::Set(d, shape.steepness);
  const auto right = hn::MulAdd(x, scale, hn::Set(d, -camera.x * camera.inverse_radius));
  const auto up = hn::MulAdd(y, scale, hn::Set(d, -camera.y * camera.inverse_radius));
  const auto height_squared = hn::Set(d, camera.height_squared);
  auto q_squared = hn::MulAdd(right, right, hn::MulAdd(up, up, height_squared));
  if (!shape.sides.empty()) {
    auto q = hn::Zero(d);
    for (const auto& side : shape.sides) {
      const auto along = hn::MulAdd(right, hn::Set(d, side[0]), hn::Mul(up, hn::Set(d, side[1])));
      q = hn::Max(q, hn::Abs(along));
    }
    q_squared = hn::MulAdd(q, q, height_squared);
  }
  const auto t = hn::Min(hn::Set(d, 1.0F),
                         hn::Max(hn::Zero(d), hn::NegMulAdd(q_squared, steepness, steepness)));
  return hn::Mul(hn::Mul(t, t), hn::NegMulAdd(hn::Set(d, 2.0F), t, hn::Set(d, 3.0F)));
}

/// Adds a camera's weights to the sums; returns false where all are 0.
HWY_INLINE bool find_aperture_weights(const ApertureCamera& camera, const ApertureShape& shape,
                                      int n, Crossings& crossings, float* weight) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  float* sum = camera.present ? crossings.present : crossings.absent;
  auto largest = hn::Zero(d);
  for (int i = 0; i < n; i += lanes) {
    const auto f = aperture_weight(d, camera, shape, hn::Load(d, crossings.x + i),
                                   hn::Load(d, crossings.y + i));
    hn::Store(f, d, weight + i);
    largest = hn::Max(largest, f);
    hn::Store(hn::Add(f, hn::Load(d, sum + i)), d, sum + i);
  }
  return !hn::AllFalse(d, hn::Gt(largest, hn::Zero(d)));
}

#if HWY_TARGET <= HWY_AVX3

/// Adds samples and weights of the cameras for which fits_windows() is true in a stretch of pixels.
/// Returns one bit for each of these cameras.
std::uint32_t add_windowed(const ApertureRun& run, std::span<const ApertureCamera> cameras,
                           int begin, int n, const CrossedBox& box, const Crossings* crossings,
                           WindowSums* sums) {
  constexpr int kTogether = 3;
  const hn::ScalableTag<float> d;
  std::uint32_t added = 0;
  WindowedCamera windowed[kTogether];
  const ApertureCamera* waiting[kTogether];
  WindowTaps taps[kTogether];
  int count = 0;
  const auto add_waiting = [&]() HWY_ATTR {
    for (int from = 0; from < n; from += kChunk) {
      const Crossings& at = crossings[from / kChunk];
      WindowSums& to = sums[from / kChunk];
      const int length = std::min(kChunk, n - from);
      for (int c = 0; c < count; ++c) {
        compute_window_taps(
            windowed[c], from, length,
            [&](int i) HWY_ATTR {
              const auto f = hn::Mul(aperture_weight(d, *waiting[c], run.shape,
                                                     hn::Load(d, at.x + i), hn::Load(d, at.y + i)),
                                     hn::Set(d, 1 / kWeightUnit));
              hn::Store(hn::Add(f, hn::Load(d, to.share + i)), d, to.share + i);
              return f;
            },
            taps[c]);
      }
      add_window_samples(windowed, taps, count, length, to);
    }
    count = 0;
  };
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const ApertureCamera& camera = cameras[i];
    if (!camera.present || camera.source->rgba == nullptr || !box.is_near(camera, run.shape)) {
      continue;
    }
    if (!fits_windows(*camera.source, begin, run.cell.y, n, windowed[count])) continue;
    added |= std::uint32_t{1} << i;
    waiting[count++] = &camera;
    if (count == kTogether) add_waiting();
  }
  if (count > 0) add_waiting();
  return added;
}

/// Adds the windowed cameras' sums to those of the other cameras.
void join(int n, const WindowSums& windowed, Crossings& crossings, float* sums) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto middle = hn::Set(d, 32768 * kWeightUnit);
  for (int i = 0; i < n; i += lanes) {
    const auto share = hn::Load(d, windowed.share + i);
    hn::Store(hn::MulAdd(share, hn::Set(d, kWeightUnit), hn::Load(d, crossings.present + i)), d,
              crossings.present + i);
    auto r = hn::MulAdd(share, middle, hn::Load(d, windowed.r + i));
    auto g = hn::MulAdd(share, middle, hn::Load(d, windowed.g + i));
    auto b = hn::MulAdd(share, middle, hn::Load(d, windowed.b + i));
    auto weight = hn::Mul(share, hn::Set(d, 65535 * kWeightUnit));
    transpose_blocks(d, r, g, b, weight);
    float* to = sums + 4 * i;
    hn::Store(hn::Add(r, hn::Load(d, to)), d, to);
    hn::Store(hn::Add(g, hn::Load(d, to + lanes)), d, to + lanes);
    hn::Store(hn::Add(b, hn::Load(d, to + 2 * lanes)), d, to + 2 * lanes);
    hn::Store(hn::Add(weight, hn::Load(d, to + 3 * lanes)), d, to + 3 * lanes);
  }
}

#else  // windows are not supported

struct WindowSums {};
std::uint32_t add_windowed(const ApertureRun&, std::span<const ApertureCamera>, int, int,
                           const CrossedBox&, const Crossings*, WindowSums*) {
  return 0;
}
void join(int, const WindowSums&, Crossings&, float*) {}

#endif

/// Computes the camera's taps for the chunk from pixel `begin` on.
void find_taps_of(const ApertureRun& run, const ApertureCamera& camera, int begin, int n,
                  const float* weight, Taps& taps) {
  if (run.inverse_depth == nullptr) {
    compute_taps(*camera.source, begin, run.cell.y, n, weight, taps);
  } else {
    compute_taps_at_depth(*camera.source, camera.per_inverse_depth.data(), begin, run.cell.y, n,
                          run.inverse_depth + (begin - run.cell.begin), weight, taps);
  }
}

/// Writes the depths of pixels with individual depths; +infinity where nothing is seen.
void write_depths(const float* inverse_depth, const float* alpha, int n, float* z) {
  for (int i = 0; i < n; ++i) {
    z[i] = alpha[i] > 0 ? 1 / inverse_depth[i] : std::numeric_limits<float>::infinity();
  }
}

/// Converts sums of weights to the factor for sums of samples (`present`) and the share of present
/// cameras in all weights (`absent`).
void find_shares(bool at_infinity, Ramp along, int n, Crossings& crossings) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto least = hn::Set(d, 1e-30F), zero = hn::Zero(d);
  for (int i = 0; i < n; i += lanes) {
    const auto present = hn::Load(d, crossings.present + i);
    const auto complete = hn::Add(present, hn::Load(d, crossings.absent + i));
    auto counts = hn::Gt(present, least);
    if (!at_infinity) {  // rays that do not meet the focal plane get no weight
      const auto slope = values(d, along, iota_from(d, i - along.start));
      counts = hn::And(counts, hn::Gt(slope, zero));
    }
    hn::Store(hn::IfThenElseZero(counts, reciprocal(d, present)), d, crossings.present + i);
    hn::Store(hn::IfThenElseZero(counts, hn::Mul(present, reciprocal(d, complete))), d,
              crossings.absent + i);
  }
}

/// Adds the samples of `cameras` except those whose bit is set in `done`.
void add_others(const ApertureRun& run, std::span<const ApertureCamera> cameras, std::uint32_t done,
                const CrossedBox& box, int begin, int n, Crossings& crossings, float* sums) {
  constexpr int kTogether = 3;
  Taps taps[kTogether];
  HWY_ALIGN float weight[kChunk];
  const SourceView* sources[kTogether];
  int waiting = 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const ApertureCamera& camera = cameras[i];
    if ((done >> i & 1) != 0 || !box.is_near(camera, run.shape)) continue;
    if (!find_aperture_weights(camera, run.shape, n, crossings, weight)) continue;
    if (!camera.present || camera.source->rgba == nullptr) continue;
    find_taps_of(run, camera, begin, n, weight, taps[waiting]);
    prefetch_taps(*camera.source, taps[waiting], n);
    sources[waiting++] = camera.source;
    if (waiting < kTogether) continue;
    add_samples<false>(sources, taps, waiting, n, sums);
    waiting = 0;
  }
  if (waiting > 0) add_samples<false>(sources, taps, waiting, n, sums);
}

void blend_aperture(const ApertureRun& run, store::BlendSpace space, float full_scale, float* rgba,
                    float* coverage, float* z, SumStage mode) {
  constexpr int kChunks = 4;
  constexpr std::size_t kCameras = 32;  // per batch
  Weights weights;
  Crossings crossings[kChunks];
  HWY_ALIGN float sums[kChunks][4 * kChunk];
  WindowSums windowed[kChunks];
  const PixelRun& cell = run.cell;
  for (int begin = cell.begin; begin < cell.end; begin += kChunks * kChunk) {
    CrossedBox box;
    bool any_windowed = false;
    const int n = std::min(kChunks * kChunk, cell.end - begin);
    const auto for_each_chunk = [&](const auto& body) HWY_ATTR {
      for (int c = 0; c * kChunk < n; ++c) {
        body(c, begin + c * kChunk, std::min(kChunk, n - c * kChunk));
      }
    };
    for_each_chunk([&](int c, int from, int length) HWY_ATTR {
      find_crossings(run, from, length, weights, crossings[c], box);
      std::fill_n(sums[c], 4 * kChunk, 0.0F);
      windowed[c] = {};
    });
    for (std::size_t i = 0; i < run.cameras.size(); i += kCameras) {
      const auto cameras = run.cameras.subspan(i, std::min(kCameras, run.cameras.size() - i));
      std::uint32_t done = 0;
      if (run.inverse_depth == nullptr && run.opaque) {
        done = add_windowed(run, cameras, begin, n, box, crossings, windowed);
      }
      any_windowed |= done != 0;
      for_each_chunk([&](int c, int from, int length) HWY_ATTR {
        add_others(run, cameras, done, box, from, length, crossings[c], sums[c]);
      });
    }
    for_each_chunk([&](int c, int from, int length) HWY_ATTR {
      const Ramp along = inverse_depth(cell.slope, cell.distance, from, cell.y, length);
      if (any_windowed) join(length, windowed[c], crossings[c], sums[c]);
      find_shares(cell.at_infinity, along, length, crossings[c]);
      const std::size_t at = static_cast<std::size_t>(from - cell.begin);
      const float* share = crossings[c].present;
      if (mode == SumStage::kSampleOnly) {
        store_sums(sums[c], share, length, rgba + 4 * at);
        return;
      }
      int room_end = std::max(cell.end, cell.room_end);
      if (mode == SumStage::kFinishOnly) {  // these are normalised already
        load_sums(rgba + 4 * at, length, sums[c]);
        share = nullptr;
        room_end = cell.end;  // pixels to the right belong to another run
      }
      write_pixels(sums[c], share, crossings[c].absent, length, room_end - from, space, full_scale,
                   along, cell.at_infinity, rgba + 4 * at, coverage + at, z + at);
      if (run.inverse_depth != nullptr) {
        write_depths(run.inverse_depth + at, coverage + at, length, z + at);
      }
    });
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
    CrossedBox box;
    find_crossings(run, begin, n, weights, crossings, box);
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
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(mark_aperture);
HWY_EXPORT(blend_aperture);

void mark_aperture_pixels(const ApertureRun& run) { HWY_DYNAMIC_DISPATCH(mark_aperture)(run); }
void blend_aperture_run(const ApertureRun& run, store::BlendSpace space, float full_scale,
                        float* rgba, float* coverage, float* z, SumStage sums) {
  HWY_DYNAMIC_DISPATCH(blend_aperture)(run, space, full_scale, rgba, coverage, z, sums);
}

}  // namespace raystage::render
#endif
