// SPDX-License-Identifier: Apache-2.0
// Kernels of the unstructured lumigraph (Buehler et al., SIGGRAPH 2001; thesis eq. 2.3), 64 rays at
// a time. They compute penalties and weights of the cameras, positions of the points in their
// frames, bilinear samples and their weighted mean. Input: RayChunk (floats about the centre of the
// rig, metres). Output: ChunkWeights, premultiplied linear light. Cost: O(rays x cameras). Must
// match compute_camera_weights_reference() (ray_weights.cpp) and lumigraph_reference.cpp.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <limits>

#include "render/lumigraph/ray_chunk.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/lumigraph/ray_chunk_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/lens-inl.h"
#include "render/sampling/run-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kRays = RayChunk::kSize;
static_assert(kRays <= kChunk);
constexpr float kNever = 1e30F;  // the penalty of a camera that does not see the point
constexpr float kTiny = 1e-20F;

/// Rays [i, i + lanes) relative to one camera.
template <class V>
struct RelativeRays {
  V offset[3];  ///< from the rays' bases to the camera
  V along;      ///< the offset's length along the ray
  V distance;   ///< of the camera from the ray's line
};

template <class D>
RelativeRays<hn::Vec<D>> relative_rays(D d, const RayChunk& chunk, const ChunkCamera& camera,
                                       int i) {
  RelativeRays<hn::Vec<D>> b;
  const auto load = [&](const std::array<float, kRays>& values)
                        HWY_ATTR { return hn::Load(d, values.data() + i); };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    b.offset[axis] = hn::Sub(hn::Set(d, camera.centre[axis]), load(chunk.base[axis]));
  }
  b.along = hn::Mul(b.offset[0], load(chunk.direction[0]));
  b.along = hn::MulAdd(b.offset[1], load(chunk.direction[1]), b.along);
  b.along = hn::MulAdd(b.offset[2], load(chunk.direction[2]), b.along);
  auto squared = hn::Zero(d);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto across = hn::NegMulAdd(b.along, load(chunk.direction[axis]), b.offset[axis]);
    squared = hn::MulAdd(across, across, squared);
  }
  b.distance = hn::Sqrt(squared);
  return b;
}

/// Stores where the camera sees the points (u, v, seen); returns v of RayWeightOptions, 0 to 1.
template <class D>
hn::Vec<D> locate(D d, const RayChunk& chunk, const ChunkCamera& camera, float border,
                  const RelativeRays<hn::Vec<D>>& b, int i, ChunkWeights& out) {
  const auto inverse = hn::Load(d, chunk.inverse_distance.data() + i);
  const auto point = hn::Load(d, chunk.point.data() + i);
  hn::Vec<D> towards[3];  // (point - camera) / distance of the point from the eye
  for (std::size_t axis = 0; axis < 3; ++axis) {
    towards[axis] = hn::Mul(point, hn::Load(d, chunk.direction[axis].data() + i));
    towards[axis] = hn::NegMulAdd(inverse, b.offset[axis], towards[axis]);
  }
  const auto in_camera = [&](std::size_t row) HWY_ATTR {
    const float* m = camera.camera_from_world.data() + 3 * row;
    auto sum = hn::Mul(hn::Set(d, m[0]), towards[0]);
    sum = hn::MulAdd(hn::Set(d, m[1]), towards[1], sum);
    return hn::MulAdd(hn::Set(d, m[2]), towards[2], sum);
  };
  const auto one = hn::Set(d, 1.0F), zero = hn::Zero(d);
  const auto depth = hn::Neg(in_camera(2));
  const auto in_front = hn::Gt(depth, zero);
  const auto scale = hn::Div(one, hn::IfThenElse(in_front, depth, one));
  const auto sight =
      camera.lens.is_fisheye
          ? project_through_fisheye(d, camera.lens, in_camera(0), hn::Neg(in_camera(1)), depth)
          : project_through_lens(d, camera.lens, hn::Mul(in_camera(0), scale),
                                 hn::Neg(hn::Mul(in_camera(1), scale)), in_front);
  hn::Store(sight.u, d, out.u.data() + i);
  hn::Store(sight.v, d, out.v.data() + i);
  hn::Store(sight.seen, d, out.seen.data() + i);
  const auto width = hn::Set(d, static_cast<float>(camera.lens.width));
  const auto height = hn::Set(d, static_cast<float>(camera.lens.height));
  const auto to_border = hn::Min(hn::Min(sight.u, hn::Sub(width, sight.u)),
                                 hn::Min(sight.v, hn::Sub(height, sight.v)));
  const float pixels = std::max(border * static_cast<float>(camera.lens.width), 1.0F);
  return hn::Min(sight.seen, hn::Mul(to_border, hn::Set(d, 1 / pixels)));
}

/// Scales the weights so that their sum is the largest `seen` among them.
void normalise(std::span<ChunkWeights> weights, int count) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < count; i += lanes) {
    // A compensated sum (Kahan): over hundreds of cameras, a plain sum has an error of 3e-6.
    auto total = hn::Zero(d), too_much = hn::Zero(d), most = hn::Zero(d);
    for (const ChunkWeights& camera : weights) {
      const auto weight = hn::Load(d, camera.weight.data() + i);
      const auto counts = hn::Gt(weight, hn::Zero(d));
      const auto part = hn::Sub(weight, too_much), sum = hn::Add(total, part);
      too_much = hn::Sub(hn::Sub(sum, total), part);
      total = sum;
      most = hn::Max(most, hn::IfThenElseZero(counts, hn::Load(d, camera.seen.data() + i)));
    }
    const auto scale = hn::Div(most, hn::Max(total, hn::Set(d, 1e-37F)));
    for (ChunkWeights& camera : weights) {
      hn::Store(hn::Mul(scale, hn::Load(d, camera.weight.data() + i)), d, camera.weight.data() + i);
    }
  }
}

void weigh(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
           const ChunkWeightOptions& weighing, std::span<ChunkWeights> weights) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto one = set(1), zero = hn::Zero(d), never = set(kNever);
  const int kept = weighing.cameras + 1;
  // The smallest penalties so far, sorted, per ray of the chunk.
  HWY_ALIGN float least[(kMaxWeightedCameras + 1) * kRays];
  for (int i = 0; i < kept * kRays; i += lanes) hn::Store(never, d, least + i);

  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const ChunkCamera& camera = *cameras[c];
    for (int i = 0; i < chunk.count; i += lanes) {
      const auto b = relative_rays(d, chunk, camera, i);
      const auto within = locate(d, chunk, camera, weighing.border, b, i, weights[c]);
      const auto inverse = hn::Load(d, chunk.inverse_distance.data() + i);
      // From point to camera, along and across the ray, divided by the point's distance from the
      // eye.
      const auto ahead = hn::NegMulAdd(b.along, inverse, hn::Load(d, chunk.point.data() + i));
      const auto across = hn::Mul(b.distance, inverse);
      const auto long_side = hn::Sqrt(hn::MulAdd(across, across, hn::Mul(ahead, ahead)));
      // Behind the point `ahead` is negative and their sum cancels; use the difference there.
      const auto behind = hn::Lt(ahead, zero);
      const auto sum = hn::Add(long_side, hn::Abs(ahead));
      const auto half = hn::IfThenElse(behind, hn::Div(sum, hn::Mul(across, inverse)),
                                       hn::Div(b.distance, hn::Max(sum, set(kTiny))));
      const auto longer = hn::IfThenElse(behind, hn::Div(sum, inverse), hn::Mul(across, half));
      const auto further = hn::Add(longer, hn::Sub(hn::Load(d, chunk.eye.data() + i), b.along));
      const auto angular =
          hn::Min(hn::Mul(set(2), half), set(static_cast<float>(kMaxAngularPenalty)));
      auto penalty = hn::MulAdd(set(weighing.angular), angular, set(weighing.least));
      penalty = hn::MulAdd(set(weighing.resolution), hn::Max(further, zero), penalty);
      const auto sees = hn::Gt(within, zero);
      const auto missed =
          hn::Sub(hn::Div(one, hn::IfThenElse(sees, hn::Min(within, one), one)), one);
      penalty = hn::MulAdd(set(weighing.field_of_view), missed, penalty);
      penalty = hn::IfThenElse(hn::And(sees, hn::Lt(penalty, never)), penalty, never);
      hn::Store(penalty, d, weights[c].weight.data() + i);
      for (int k = 0; k < kept; ++k) {
        float* at = least + k * kRays + i;
        const auto known = hn::Load(d, at);
        hn::Store(hn::Min(known, penalty), d, at);
        penalty = hn::Max(known, penalty);
      }
    }
  }

  for (int i = 0; i < chunk.count; i += lanes) {
    const auto next = hn::Load(d, least + (kept - 1) * kRays + i);
    const auto per_threshold = hn::IfThenElseZero(
        hn::Lt(next, never), hn::Div(one, hn::Mul(next, set(1 + static_cast<float>(kSoftening)))));
    for (ChunkWeights& camera : weights) {
      const auto penalty = hn::Load(d, camera.weight.data() + i);
      const auto weight =
          hn::Div(hn::Max(hn::NegMulAdd(penalty, per_threshold, one), zero), penalty);
      hn::Store(hn::IfThenElseZero(hn::Lt(penalty, never), weight), d, camera.weight.data() + i);
    }
  }
  normalise(weights, chunk.count);
}

void share(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
           std::span<ChunkWeights> weights) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (int i = 0; i < chunk.count; i += lanes) {
      const auto b = relative_rays(d, chunk, *cameras[c], i);
      locate(d, chunk, *cameras[c], 0.0F, b, i, weights[c]);
      const auto seen = hn::Load(d, weights[c].seen.data() + i);
      const auto weight = hn::Load(d, weights[c].weight.data() + i);
      hn::Store(hn::IfThenElseZero(hn::Gt(seen, hn::Zero(d)), weight), d,
                weights[c].weight.data() + i);
    }
  }
  normalise(weights, chunk.count);
}

void measure(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
             std::span<const ChunkWeights> weights, float* HWY_RESTRICT effective,
             float* HWY_RESTRICT nearest) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto zero = hn::Zero(d);
  const auto none = hn::Set(d, std::numeric_limits<float>::infinity());
  for (int i = 0; i < chunk.count; i += lanes) {
    auto sum = zero, squares = zero, least = none;
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      const auto weight = hn::Load(d, weights[c].weight.data() + i);
      const auto has_weight = hn::Gt(weight, zero);
      if (hn::AllFalse(d, has_weight)) continue;
      sum = hn::Add(sum, weight);
      squares = hn::MulAdd(weight, weight, squares);
      const auto distance = relative_rays(d, chunk, *cameras[c], i).distance;
      least = hn::Min(least, hn::IfThenElse(has_weight, distance, none));
    }
    hn::Store(hn::Div(hn::Mul(sum, sum), hn::Max(squares, hn::Set(d, kTiny))), d, effective + i);
    hn::Store(least, d, nearest + i);
  }
}

int count_rays(const ChunkWeights& weights, int count) {
  const hn::ScalableTag<float> d;
  std::size_t rays = 0;
  for (int i = 0; i < count; i += static_cast<int>(hn::Lanes(d))) {
    const auto is_ray = hn::Lt(iota_from(d, i), hn::Set(d, static_cast<float>(count)));
    const auto weight = hn::Load(d, weights.weight.data() + i);
    rays += hn::CountTrue(d, hn::And(is_ray, hn::Gt(weight, hn::Zero(d))));
  }
  return static_cast<int>(rays);
}

bool any(const ChunkWeights& weights, int count) { return count_rays(weights, count) > 0; }

/// Returns the sampling positions of rays [i, i + lanes), relative to the first pixel's centre.
template <class D>
FramePosition<hn::Vec<D>> position(D d, const SourceView& lens, const ChunkWeights& weights,
                                   int i) {
  const auto half = hn::Set(d, 0.5F), zero = hn::Zero(d);
  const auto within = [&](const std::array<float, kRays>& at, int size) HWY_ATTR {
    const auto last = hn::Set(d, static_cast<float>(size - 1));
    return hn::Min(hn::Max(hn::Sub(hn::Load(d, at.data() + i), half), zero), last);
  };
  return {within(weights.u, lens.width), within(weights.v, lens.height),
          hn::Load(d, weights.weight.data() + i)};
}

void find_taps_of(const SourceView& lens, const ChunkWeights& weights, int count, Taps& taps) {
  const hn::ScalableTag<float> d;
  const auto half = hn::Set(d, 0.5F);
  for (int i = 0; i < count; i += static_cast<int>(hn::Lanes(d))) {
    const auto at = position(d, lens, weights, i);
    store_taps(d, lens.width, hn::Sub(at.u, half), hn::Sub(at.v, half), at.seen, i, taps);
  }
  pad_taps(count, taps);
}

/// Adds the samples of one camera ray by ray: the same result as add_samples(), faster for few
/// rays.
void add_few(const SourceView& lens, const Taps& taps, int count, float* HWY_RESTRICT sums) {
  const hn::FixedTag<float, 4> d;
  const hn::RebindToSigned<decltype(d)> di;
  const std::size_t row = std::size_t{4} * static_cast<std::size_t>(lens.width);
  for (int i = 0; i < count; ++i) {
    if (!(taps.share[i] > 0)) continue;
    float* sum = sums + 4 * transposed_index(hn::ScalableTag<float>(), i);
    hn::Store(add_taps<0>(d, lens.rgba, row, taps.pixel + i, hn::Set(di, taps.upper[i]),
                          hn::Set(di, taps.lower[i]), hn::Set(d, taps.share[i]), hn::Load(d, sum)),
              d, sum);
  }
}

void sample_cameras(std::span<const ChunkCamera* const> cameras,
                    std::span<const ChunkWeights> weights, int count, float* HWY_RESTRICT sums) {
  constexpr int kTogether = 4;
  Taps taps[kTogether];
  const SourceView* sources[kTogether];
  int waiting = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const SourceView& lens = cameras[c]->lens;
    const int rays = lens.rgba == nullptr ? 0 : count_rays(weights[c], count);
    if (rays == 0) continue;
    find_taps_of(lens, weights[c], count, taps[waiting]);
    if (2 * rays < count) {
      add_few(lens, taps[waiting], count, sums);
      continue;
    }
    sources[waiting++] = &lens;
    if (waiting < kTogether) continue;
    add_samples<false>(sources, taps, waiting, count, sums);
    waiting = 0;
  }
  add_samples<false>(sources, taps, waiting, count, sums);
}

void blend_all(std::span<const ChunkCamera* const> cameras, std::span<const ChunkWeights> weights,
               int count, store::BlendSpace space, float full_scale, float* HWY_RESTRICT rgba,
               SumStage mode) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  HWY_ALIGN float sums[4 * kRays] = {};
  if (mode == SumStage::kFinishOnly) {
    load_sums(rgba, count, sums);
  } else {
    sample_cameras(cameras, weights, count, sums);
  }
  if (mode == SumStage::kSampleOnly) {
    store_sums(sums, nullptr, count, rgba);
    return;
  }
  for (int i = 0; i < count; i += lanes) {
    const float* from = sums + 4 * i;
    auto r = hn::Load(d, from), g = hn::Load(d, from + lanes);
    auto b = hn::Load(d, from + 2 * lanes), weight = hn::Load(d, from + 3 * lanes);
    transpose_blocks(d, r, g, b, weight);
    finish(d, space, full_scale, r, g, b, weight);
    if (i + lanes <= count) {
      hn::StoreInterleaved4(r, g, b, weight, d, rgba + 4 * i);
    } else {
      Pixels last;
      hn::StoreInterleaved4(r, g, b, weight, d, last.rgba);
      std::copy_n(last.rgba, 4 * (count - i), rgba + 4 * i);
    }
  }
}

/// A rectangle of a frame's pixels, bounds included.
struct PixelBox {
  float left, top, right, bottom;
};

void mark_box(const SourceView& lens, const PixelBox& box) {
  const int reach = lens.chroma_radius;
  const int first_x = std::max(0, static_cast<int>(box.left) - reach) >> lens.mcu_width_log2;
  const int first_y = std::max(0, static_cast<int>(box.top) - reach) >> lens.mcu_height_log2;
  const int last_x = std::min(lens.width - 1, static_cast<int>(box.right) + 1 + reach);
  const int last_y = std::min(lens.height - 1, static_cast<int>(box.bottom) + 1 + reach);
  for (int y = first_y; y <= last_y >> lens.mcu_height_log2; ++y) {
    for (int x = first_x; x <= last_x >> lens.mcu_width_log2; ++x) {
      mark_mcu(lens.wanted_mcus, y * lens.mcus_per_row + x);
    }
  }
}

void mark(const SourceView& lens, const ChunkWeights& weights, int count) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  HWY_ALIGN float left[kRays], top[kRays];
  const auto never = hn::Set(d, kNever);
  for (int i = 0; i < count; i += lanes) {
    const auto at = position(d, lens, weights, i);
    const auto is_ray = hn::Lt(iota_from(d, i), hn::Set(d, static_cast<float>(count)));
    const auto counts = hn::And(is_ray, hn::Gt(at.seen, hn::Zero(d)));
    if (hn::AllFalse(d, counts)) continue;
    const auto least = [&](auto values) HWY_ATTR {
      return hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(counts, values, never)));
    };
    const auto most = [&](auto values) HWY_ATTR {
      return hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElseZero(counts, values)));
    };
    const PixelBox box{least(at.u), least(at.v), most(at.u), most(at.v)};
    // Adjacent rays usually read adjacent pixels; if not, mark pixel by pixel.
    const float wide = 2.0F * static_cast<float>(lanes);
    if (box.right - box.left <= wide && box.bottom - box.top <= wide) {
      mark_box(lens, box);
      continue;
    }
    hn::Store(at.u, d, left + i);
    hn::Store(at.v, d, top + i);
    for (int k = i; k < std::min(i + lanes, count); ++k) {
      if (!(weights.weight[k] > 0)) continue;
      mark_box(lens, {left[k], top[k], left[k], top[k]});
    }
  }
  if (lens.read_pixels == nullptr) return;
  Taps taps;
  find_taps_of(lens, weights, count, taps);
  mark_pixels(lens, taps, count);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(weigh);
HWY_EXPORT(share);
HWY_EXPORT(measure);
HWY_EXPORT(any);
HWY_EXPORT(blend_all);
HWY_EXPORT(mark);

void compute_camera_weights(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                            const ChunkWeightOptions& weighing, std::span<ChunkWeights> weights) {
  HWY_DYNAMIC_DISPATCH(weigh)(chunk, cameras, weighing, weights);
}
void apply_given_weights(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                         std::span<ChunkWeights> weights) {
  HWY_DYNAMIC_DISPATCH(share)(chunk, cameras, weights);
}
void measure_effective_cameras(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                               std::span<const ChunkWeights> weights, float* effective,
                               float* nearest) {
  HWY_DYNAMIC_DISPATCH(measure)(chunk, cameras, weights, effective, nearest);
}
bool has_weight(const ChunkWeights& weights, int count) {
  return HWY_DYNAMIC_DISPATCH(any)(weights, count);
}
void blend_chunk(std::span<const ChunkCamera* const> cameras, std::span<const ChunkWeights> weights,
                 int count, store::BlendSpace space, float full_scale, float* rgba, SumStage sums) {
  HWY_DYNAMIC_DISPATCH(blend_all)(cameras, weights, count, space, full_scale, rgba, sums);
}
void mark_needed_mcus(const SourceView& lens, const ChunkWeights& weights, int count) {
  HWY_DYNAMIC_DISPATCH(mark)(lens, weights, count);
}
}  // namespace raystage::render
#endif
