// SPDX-License-Identifier: Apache-2.0
// Kernels that sample cameras for pixels with individual depths. Per pixel: position (X, Y, W) = a
// (x, y, 1) + q b with inverse depth q, lens model, bilinear or bicubic interpolation (Keys 1981),
// and accumulation with weights. Also converts the sums to linear light. Cost: O(pixels) per
// camera. Must match sample_at_depth_reference() (depth_sampling.cpp).
#include <algorithm>
#include <cstddef>

#include "render/sampling/depth_sampling.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sampling/depth_sampling_kernels.cpp"
// The order of these includes matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>
#include "render/sampling/finish-inl.h"
#include "render/sampling/lens-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Pixels per chunk: positions are vectors across pixels, samples are vectors across colours.
constexpr int kChunk = 64;
constexpr int kReach = 4;  ///< pixels read along each axis, at most

/// The positions in a camera's frame for each pixel of a chunk.
struct Positions {
  HWY_ALIGN std::int32_t x[kChunk], y[kChunk];  ///< pixel to the upper left of the position
  HWY_ALIGN float right[kChunk], down[kChunk];  ///< fraction of a pixel from there, 0 to 1
  HWY_ALIGN float weight[kChunk];
};

/// A chunk's inputs, padded to whole vectors.
struct Inputs {
  HWY_ALIGN float inverse_depth[kChunk], weight[kChunk];
};

void find_positions(const DepthSource& source, int x, int y, int n, const Inputs& inputs,
                    Positions& positions) {
  const hn::ScalableTag<float> d;
  const hn::RebindToSigned<decltype(d)> di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const double* m = source.camera.ideal_from_pixel.data();
  const auto set = [&](double value) HWY_ATTR { return hn::Set(d, static_cast<float>(value)); };
  // The base in double, steps from there in float.
  const auto base = [&](int row) HWY_ATTR {
    return set(m[3 * row] * (x + 0.5) + (m[3 * row + 1] * (y + 0.5) + m[3 * row + 2]));
  };
  const auto base_x = base(0), base_y = base(1), base_w = base(2);
  const auto step_x = set(m[0]), step_y = set(m[3]), step_w = set(m[6]);
  const auto deep_x = set(source.per_inverse_depth[0]), deep_y = set(source.per_inverse_depth[1]);
  const auto deep_w = set(source.per_inverse_depth[2]);
  const auto zero = hn::Zero(d), one = set(1), half = set(0.5);
  const auto last_x = set(source.camera.width - 1), last_y = set(source.camera.height - 1);
  for (int i = 0; i < n; i += lanes) {
    const auto steps = hn::Iota(d, static_cast<float>(i));
    const auto q = hn::Load(d, inputs.inverse_depth + i);
    const auto w = hn::MulAdd(q, deep_w, hn::MulAdd(steps, step_w, base_w));
    const auto right = hn::MulAdd(q, deep_x, hn::MulAdd(steps, step_x, base_x));
    const auto down = hn::MulAdd(q, deep_y, hn::MulAdd(steps, step_y, base_y));
    const auto in_front = hn::Gt(w, zero);
    const auto inverse = hn::Div(one, hn::IfThenElse(in_front, w, one));
    const auto sight = source.camera.is_fisheye
                           ? project_through_fisheye(d, source.camera, right, down, w)
                           : project_through_lens(d, source.camera, hn::Mul(right, inverse),
                                                  hn::Mul(down, inverse), in_front);
    const auto left = hn::Min(hn::Max(hn::Sub(sight.u, half), zero), last_x);
    const auto top = hn::Min(hn::Max(hn::Sub(sight.v, half), zero), last_y);
    const auto x0 = hn::Floor(left), y0 = hn::Floor(top);
    hn::Store(hn::ConvertTo(di, x0), di, positions.x + i);
    hn::Store(hn::ConvertTo(di, y0), di, positions.y + i);
    hn::Store(hn::Sub(left, x0), d, positions.right + i);
    hn::Store(hn::Sub(top, y0), d, positions.down + i);
    hn::Store(hn::Mul(sight.seen, hn::Load(d, inputs.weight + i)), d, positions.weight + i);
  }
}

/// Returns Keys' four weights times `scale` for a position `f` after the second of four pixels.
template <class D, class V>
HWY_INLINE void store_cubic(D d, V f, V scale, float* HWY_RESTRICT weights) {
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  constexpr float a = kCubicSlope;
  const auto g = hn::Sub(set(1), f), fg = hn::Mul(hn::Mul(f, g), set(a));
  const auto inner = [&](V x) HWY_ATTR {
    return hn::MulAdd(hn::Mul(x, x), hn::MulAdd(set(a + 2), x, set(-a - 3)), set(1));
  };
  const auto w0 = hn::Mul(fg, g), w1 = inner(f), w2 = inner(g), w3 = hn::Mul(fg, f);
  hn::StoreInterleaved4(hn::Mul(w0, scale), hn::Mul(w1, scale), hn::Mul(w2, scale),
                        hn::Mul(w3, scale), d, weights);
}

/// Sums neighbouring pixels that are side by side in a vector, per channel.
template <class D, class V>
HWY_INLINE auto sum_of_pixels(D d, V pixels) {
  if constexpr (hn::MaxLanes(d) <= 4) {
    return pixels;
  } else {
    const hn::Half<D> half;
    return sum_of_pixels(half, hn::Add(hn::LowerHalf(half, pixels), hn::UpperHalf(half, pixels)));
  }
}

/// Adds the weighted sum of 4 x 4 pixels, in vectors as wide as four pixels. `row`: 16-bit words
/// from one row to the next.
HWY_INLINE void add_cubic_sample(const std::uint16_t* from, std::ptrdiff_t row, const float* across,
                                 const float* down, float* HWY_RESTRICT sum) {
  const hn::CappedTag<float, 16> d;
  const hn::Rebind<std::uint16_t, decltype(d)> d16;
  const hn::Rebind<std::int32_t, decltype(d)> d32;
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(d));
  const hn::FixedTag<float, 4> d4;
  const auto across_all = hn::LoadDup128(d, across);
  const auto lane = hn::Iota(d32, 0);
  auto total = hn::Zero(d);
  for (int begin = 0; begin < 16; begin += kLanes) {
    const auto pixels = [&](int r) HWY_ATTR {
      return hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, from + r * row + begin)));
    };
    // Two independent sums avoid latency.
    const auto upper =
        hn::MulAdd(hn::Set(d, down[1]), pixels(1), hn::Mul(hn::Set(d, down[0]), pixels(0)));
    const auto lower =
        hn::MulAdd(hn::Set(d, down[3]), pixels(3), hn::Mul(hn::Set(d, down[2]), pixels(2)));
    const auto of_pixel = hn::ShiftRight<2>(hn::Add(lane, hn::Set(d32, begin)));
    const auto weights = hn::TableLookupLanes(across_all, hn::IndicesFromVec(d, of_pixel));
    total = hn::MulAdd(hn::Add(upper, lower), weights, total);
  }
  hn::StoreU(hn::Add(hn::LoadU(d4, sum), sum_of_pixels(d, total)), d4, sum);
}

void add_cubic(const SourceView& camera, const Positions& positions, int n, float* sums) {
  const hn::ScalableTag<float> d;
  HWY_ALIGN float across[4 * kChunk], down[4 * kChunk];
  for (int i = 0; i < n; i += static_cast<int>(hn::Lanes(d))) {
    store_cubic(d, hn::Load(d, positions.right + i), hn::Set(d, 1.0F), across + 4 * i);
    store_cubic(d, hn::Load(d, positions.down + i), hn::Load(d, positions.weight + i),
                down + 4 * i);
  }
  const auto row = static_cast<std::ptrdiff_t>(camera.width) * 4;
  const auto inner_columns = static_cast<unsigned>(std::max(0, camera.width - 3));
  const auto inner_rows = static_cast<unsigned>(std::max(0, camera.height - 3));
  for (int i = 0; i < n; ++i) {
    if (positions.weight[i] == 0) continue;
    const int x = positions.x[i] - 1, y = positions.y[i] - 1;
    if (static_cast<unsigned>(x) < inner_columns && static_cast<unsigned>(y) < inner_rows) {
      add_cubic_sample(camera.rgba + y * row + 4 * x, row, across + 4 * i, down + 4 * i,
                       sums + 4 * i);
      continue;
    }
    std::uint16_t edge[16 * 4];
    for (int pixel = 0; pixel < 16; ++pixel) {
      const int column = std::clamp(x + pixel % 4, 0, camera.width - 1);
      const int line = std::clamp(y + pixel / 4, 0, camera.height - 1);
      std::copy_n(camera.rgba + line * row + 4 * column, 4, edge + 4 * pixel);
    }
    add_cubic_sample(edge, 16, across + 4 * i, down + 4 * i, sums + 4 * i);
  }
}

void add_linear(const SourceView& camera, const Positions& positions, int n, float* sums) {
  const hn::FixedTag<float, 4> d;
  const hn::Rebind<std::uint16_t, decltype(d)> d16;
  const hn::Rebind<std::int32_t, decltype(d)> d32;
  const auto pixel = [&](const std::uint16_t* at) HWY_ATTR {
    return hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, at)));
  };
  const auto row = static_cast<std::ptrdiff_t>(camera.width) * 4;
  for (int i = 0; i < n; ++i) {
    if (positions.weight[i] == 0) continue;
    const std::uint16_t* upper = camera.rgba + positions.y[i] * row + positions.x[i] * 4;
    const std::uint16_t* lower = upper + row;
    const float below = positions.weight[i] * positions.down[i];
    const float above = positions.weight[i] - below;
    const float below_right = below * positions.right[i], above_right = above * positions.right[i];
    auto sum = hn::LoadU(d, sums + 4 * i);
    sum = hn::MulAdd(hn::Set(d, above - above_right), pixel(upper), sum);
    sum = hn::MulAdd(hn::Set(d, above_right), pixel(upper + 4), sum);
    sum = hn::MulAdd(hn::Set(d, below - below_right), pixel(lower), sum);
    sum = hn::MulAdd(hn::Set(d, below_right), pixel(lower + 4), sum);
    hn::StoreU(sum, d, sums + 4 * i);
  }
}

/// Calls body(first pixel, count, positions) for each chunk.
template <class Body>
HWY_INLINE void for_each_chunk(const DepthSource& source, int x, int y,
                               std::span<const float> inverse_depth, std::span<const float> weight,
                               const Body& body) {
  Inputs inputs;
  Positions positions;
  const int count = static_cast<int>(inverse_depth.size());
  for (int begin = 0; begin < count; begin += kChunk) {
    const int n = std::min(kChunk, count - begin);
    std::copy_n(inverse_depth.data() + begin, n, inputs.inverse_depth);
    std::copy_n(weight.data() + begin, n, inputs.weight);
    const int padded = std::min(kChunk, n + static_cast<int>(hn::Lanes(hn::ScalableTag<float>())));
    std::fill(inputs.inverse_depth + n, inputs.inverse_depth + padded, 0.0F);
    std::fill(inputs.weight + n, inputs.weight + padded, 0.0F);
    find_positions(source, x + begin, y, n, inputs, positions);
    body(begin, n, positions);
  }
}

void add(const DepthSource& source, int x, int y, std::span<const float> inverse_depth,
         std::span<const float> weight, Interpolation interpolation, std::span<float> sums) {
  for_each_chunk(source, x, y, inverse_depth, weight,
                 [&](int begin, int n, const Positions& positions) HWY_ATTR {
                   float* at = sums.data() + 4 * begin;
                   if (interpolation == Interpolation::kCubic) {
                     add_cubic(source.camera, positions, n, at);
                   } else {
                     add_linear(source.camera, positions, n, at);
                   }
                 });
}

void add_seen(const DepthSource& source, int x, int y, std::span<const float> inverse_depth,
              std::span<const float> weight, std::span<float> seen) {
  for_each_chunk(source, x, y, inverse_depth, weight,
                 [&](int begin, int n, const Positions& positions) {
                   float* at = seen.data() + begin;
                   for (int i = 0; i < n; ++i) at[i] += 65535.0F * positions.weight[i];
                 });
}

/// The pixels read along an axis: those of taps with a weight other than 0.
struct Read {
  int first, last;
};
Read read_along(int at, float part, Interpolation interpolation, int size) {
  if (part == 0) return {at, at};
  const int before = interpolation == Interpolation::kCubic ? 1 : 0,
            behind = interpolation == Interpolation::kCubic ? 2 : 1;
  return {std::max(0, at - before), std::min(size - 1, at + behind)};
}

void mark(const DepthSource& source, int x, int y, std::span<const float> inverse_depth,
          std::span<const float> weight, Interpolation interpolation) {
  const SourceView& camera = source.camera;
  const auto mark_sample = [&](Read columns, Read rows) {
    if (camera.read_pixels != nullptr) {
      for (int row = rows.first; row <= rows.last; ++row) {
        std::fill_n(
            camera.read_pixels + static_cast<std::ptrdiff_t>(row) * camera.width + columns.first,
            columns.last - columns.first + 1, std::uint8_t{1});
      }
    }
    if (camera.wanted_mcus == nullptr) return;
    const int reach = camera.chroma_radius;
    const int left = std::max(0, columns.first - reach) >> camera.mcu_width_log2;
    const int right = std::min(camera.width - 1, columns.last + reach) >> camera.mcu_width_log2;
    const int top = std::max(0, rows.first - reach) >> camera.mcu_height_log2;
    const int bottom = std::min(camera.height - 1, rows.last + reach) >> camera.mcu_height_log2;
    static_assert(kReach + 2 <= 8, "no sample reaches across a whole MCU");
    for (const int row : {top, bottom}) {
      camera.wanted_mcus[row * camera.mcus_per_row + left] = 1;
      camera.wanted_mcus[row * camera.mcus_per_row + right] = 1;
    }
  };
  for_each_chunk(source, x, y, inverse_depth, weight, [&](int, int n, const Positions& at) {
    for (int i = 0; i < n; ++i) {
      if (at.weight[i] == 0) continue;
      mark_sample(read_along(at.x[i], at.right[i], interpolation, camera.width),
                  read_along(at.y[i], at.down[i], interpolation, camera.height));
    }
  });
}

/// Converts sums to linear light. `seen`: visibility sums; empty if equal to the sums' A.
void finish_all(std::span<const float> sums, std::span<const float> seen, store::BlendSpace space,
                float full_scale, std::span<float> rgba) {
  const hn::FixedTag<float, 4> d;
  const auto full = hn::Set(d, 65535.0F);
  HWY_ALIGN float part[4 * kChunk];
  const std::size_t count = sums.size();
  for (std::size_t begin = 0; begin < count; begin += std::size(part)) {
    const std::size_t n = std::min(std::size(part), count - begin);
    for (std::size_t i = 0; i < n; i += 4) {
      const auto sum = hn::LoadU(d, sums.data() + begin + i);
      const auto own = hn::Broadcast<3>(sum);
      // Cubic interpolation of mattes overshoots, too.
      const auto all = seen.empty() ? own : hn::Set(d, seen[(begin + i) / 4]);
      const auto most = hn::Min(hn::Max(own, hn::Zero(d)), all);
      const auto colour = hn::Min(hn::Max(sum, hn::Zero(d)), most);
      const auto alpha = hn::Min(hn::Mul(all, hn::Set(d, 1 / kFullAlphaWeight)), full);
      const auto scale = hn::Div(alpha, hn::Max(all, hn::Set(d, 1e-20F)));
      hn::Store(hn::Mul(colour, scale), d, part + i);
    }
    finish(part, static_cast<int>(n / 4), space, full_scale, rgba.data() + begin);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(add);
HWY_EXPORT(add_seen);
HWY_EXPORT(mark);
HWY_EXPORT(finish_all);

void add_samples_at_depth(const DepthSource& source, int x, int y,
                          std::span<const float> inverse_depth, std::span<const float> weight,
                          Interpolation interpolation, std::span<float> sums) {
  HWY_DYNAMIC_DISPATCH(add)(source, x, y, inverse_depth, weight, interpolation, sums);
}
void add_visibility_at_depth(const DepthSource& source, int x, int y,
                             std::span<const float> inverse_depth, std::span<const float> weight,
                             std::span<float> seen) {
  HWY_DYNAMIC_DISPATCH(add_seen)(source, x, y, inverse_depth, weight, seen);
}
void mark_samples_at_depth(const DepthSource& source, int x, int y,
                           std::span<const float> inverse_depth, std::span<const float> weight,
                           Interpolation interpolation) {
  HWY_DYNAMIC_DISPATCH(mark)(source, x, y, inverse_depth, weight, interpolation);
}
void finish_samples(std::span<const float> sums, store::BlendSpace space, float full_scale,
                    std::span<float> rgba) {
  HWY_DYNAMIC_DISPATCH(finish_all)(sums, {}, space, full_scale, rgba);
}
void finish_samples(std::span<const float> sums, std::span<const float> seen,
                    store::BlendSpace space, float full_scale, std::span<float> rgba) {
  HWY_DYNAMIC_DISPATCH(finish_all)(sums, seen, space, full_scale, rgba);
}

}  // namespace raystage::render
#endif
