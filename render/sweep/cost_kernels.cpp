// SPDX-License-Identifier: Apache-2.0
// Kernels of the plane sweep's matching costs, 32 pixels at a time. They compute positions of the
// pixels in each camera plane by plane (block_positions-inl.h), bilinear samples
// (block_samples-inl.h) and the mean truncated difference from the mean colour. On request the
// worst cameras are excluded (Kang, Szeliski and Chai, CVPR 2001). Output: bytes, 255 = truncation.
// Cost: O(pixels x planes x cameras). Must match matching_cost_reference()
// (cost_kernels_reference.cpp).
#include "render/sweep/cost_kernels.h"

#include <algorithm>

#include "matching/matching.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/sweep/cost_kernels.cpp"
// The order matters.
// clang-format off
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "render/sweep/block_positions-inl.h"
#include "render/sweep/block_samples-inl.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace raystage::render {
namespace HWY_NAMESPACE {
namespace {

/// Samples of a camera for as many pixels as a vector of codes has lanes.
struct Samples {
  Codes red, green, blue;
};

struct Camera {
  BlockProjection projection;
  BlockPositions positions;
  Row origin;  ///< from the origin of the positions on
};

/// The pixels of a vector of codes: lanes 2i and 2i + 1 are lane i of two float vectors.
struct Pixels {
  Floats first, second;
  int part = 0;  ///< index of `first` among the vectors of the block
};

struct Taps {
  Words3 words;
  ColumnTaps columns;
  Codes rows;
};
HWY_INLINE Codes channel_of(Words a, const Taps& first, Words b, const Taps& second) {
  return join(weigh(a, first.columns, first.rows), weigh(b, second.columns, second.rows));
}
HWY_INLINE Samples samples_of(const Taps& first, const Taps& second) {
  return {channel_of(first.words.red, first, second.words.red, second),
          channel_of(first.words.green, first, second.words.green, second),
          channel_of(first.words.blue, first, second.words.blue, second)};
}
/// Returns taps. `y`: from the first row needed.
HWY_INLINE Taps make_taps(const Row& origin, const SourceBounds& need, Ints x, Ints y) {
  const ColumnTaps columns = column_taps(x);
  if (HWY_LIKELY(need.more_rows == 0)) {
    return {gather_row(origin.below(need.row), need.column, columns.column), columns,
            row_weights(y)};
  }
  const auto part = hn::And(y, hn::Set(IntTag(), (1 << kRowBits) - 1));
  return {gather_rows(origin, need, columns.column, hn::ShiftRight<kRowBits>(y)), columns,
          row_weights(part)};
}

HWY_INLINE Ints evaluate_rounded(const float* c0, const float* c1, const float* c2, Floats x) {
  const FloatTag d;
  return evaluate_rounded(Curve<Floats>{hn::Set(d, *c0), hn::Set(d, *c1), hn::Set(d, *c2)}, x);
}

/// Returns taps at the fitted positions; all of them are seen.
HWY_INLINE Taps taps_along(const Camera& camera, Floats x, int part, int plane) {
  const BlockPositions& p = camera.positions;
  const std::ptrdiff_t i = part * p.stride + plane;
  return make_taps(camera.origin, {p.column[i], p.row[i] >> 2, p.row[i] & 3},
                   evaluate_rounded(p.u[0] + plane, p.u[1] + plane, p.u[2] + plane, x),
                   evaluate_rounded(p.v[0] + i, p.v[1] + plane, p.v[2] + plane, x));
}
HWY_INLINE Samples sample_fitted(const Camera& camera, const Pixels& x, int plane) {
  return samples_of(taps_along(camera, x.first, x.part, plane),
                    taps_along(camera, x.second, x.part + 1, plane));
}

/// Returns samples at exact positions. Lanes of `seen` become 0 if unseen, else all bits are set.
HWY_INLINE Samples sample_exactly(const Camera& camera, const Pixels& x, int plane, Codes& seen) {
  const FloatTag d;
  const CodeTag dc;
  const auto fixed = [&](Floats at, float least, float most, int bits) HWY_ATTR {
    const auto within = hn::Min(hn::Max(at, hn::Set(d, least)), hn::Set(d, most));
    return hn::NearestInt(hn::Mul(within, hn::Set(d, static_cast<float>(1 << bits))));
  };
  const BlockProjection& projection = camera.projection;
  const auto taps_at = [&](const auto& place) HWY_ATTR {
    const IntTag di;
    const Ints u = fixed(place.u, projection.min_u(), projection.max_u(), kColumnBits);
    const Ints v = fixed(place.v, projection.min_v(), projection.max_v(), kRowBits);
    const std::int32_t column = hn::GetLane(hn::MinOfLanes(di, u)) >> kColumnBits;
    const std::int32_t top = hn::GetLane(hn::MinOfLanes(di, v)) >> kRowBits;
    const std::int32_t bottom = hn::GetLane(hn::MaxOfLanes(di, v)) >> kRowBits;
    return make_taps(camera.origin, {column, top, std::min(bottom - top, 2)}, u,
                     hn::Sub(v, hn::Set(di, top << kRowBits)));
  };
  const auto first = projection.along_row(d, x.first, plane);
  const auto second = projection.along_row(d, x.second, plane);
  const Samples all = samples_of(taps_at(first), taps_at(second));
  const auto mask = [&](auto lanes) HWY_ATTR { return hn::BitCast(dc, hn::VecFromMask(d, lanes)); };
  seen = hn::OddEven(mask(second.seen), mask(first.seen));
  return {hn::And(all.red, seen), hn::And(all.green, seen), hn::And(all.blue, seen)};
}

/// Returns |a - b|, less than 2^15.
HWY_INLINE Codes difference(Codes a, Codes b) {
  const CodeTag d;
  const hn::RebindToSigned<CodeTag> di;
  return hn::BitCast(d, hn::Abs(hn::BitCast(di, hn::Sub(a, b))));
}

/// Fixed-point scaling of the costs. Sums over all cameras must fit 16 bits with the best
/// precision: differences are shifted right by `right` bits, or their sum left by `left`.
struct CostScale {
  explicit CostScale(const CostRun& run) : cameras(static_cast<int>(run.cameras.size())) {
    const int all = std::max(cameras, 2);
    int most = static_cast<int>(run.truncation * 3 * (1 << kCodeBits));
    for (; most * all > 0xFFFF; most /= 2) ++right;
    while ((most * all) << (left + 1) <= 0xFFFF) ++left;
    truncation = most;
    for (int n = 2; n <= all; ++n) {
      part[n] = static_cast<std::uint16_t>(65536 / n);
      scale[n] = static_cast<std::uint16_t>(65536.0 * 16 * 255 / ((most * n) << left));
    }
  }
  int cameras = 0;
  int right = 0, left = 0;
  int truncation = 0;  ///< of the sum of the differences of three channels
  /// By number of cameras: factors from a sum to the mean, and to 16 times the cost.
  std::array<std::uint16_t, kMaxMatchedCameras + 1> part{}, scale{};
};

/// The mean colour of the cameras that see the pixels, and the factors for their number.
struct Mean {
  Codes red, green, blue;
  Codes count;  ///< 0 if all see
  Codes scale;
};
HWY_INLINE Codes codes(int value) { return hn::Set(CodeTag(), static_cast<std::uint16_t>(value)); }

/// Returns the mean colour. `kAllSeen`: every camera sees every pixel; else `seen` says which.
template <bool kAllSeen>
HWY_INLINE Mean mean_of(const CostScale& scaling, const Samples* samples, const Codes* seen) {
  const CodeTag d;
  auto red = hn::Zero(d), green = red, blue = red, count = red;
  for (int i = 0; i < scaling.cameras; ++i) {
    red = hn::Add(red, samples[i].red);
    green = hn::Add(green, samples[i].green);
    blue = hn::Add(blue, samples[i].blue);
    if (!kAllSeen) count = hn::Sub(count, seen[i]);  // seen is -1
  }
  const auto most = static_cast<std::size_t>(std::max(scaling.cameras, 2));
  auto part = codes(scaling.part[most]), scale = codes(scaling.scale[most]);
  for (std::size_t n = 2; !kAllSeen && n < most; ++n) {
    const auto is_n = hn::Eq(count, codes(static_cast<int>(n)));
    part = hn::IfThenElse(is_n, codes(scaling.part[n]), part);
    scale = hn::IfThenElse(is_n, codes(scaling.scale[n]), scale);
  }
  return {hn::MulHigh(red, part), hn::MulHigh(green, part), hn::MulHigh(blue, part), count, scale};
}
/// Returns the sum of the differences of three channels from the mean.
HWY_INLINE Codes difference_from(const Samples& sample, const Mean& mean) {
  return hn::Add(hn::Add(difference(sample.red, mean.red), difference(sample.green, mean.green)),
                 difference(sample.blue, mean.blue));
}

/// Marks the camera farthest from the mean as unseen (of equals the first), if more than two see
/// it.
HWY_INLINE void exclude_worst(const CostScale& scaling, Samples* samples, Codes* seen) {
  const CodeTag d;
  const Mean mean = mean_of<false>(scaling, samples, seen);
  std::array<Codes, kMaxMatchedCameras> offs;
  auto most = hn::Zero(d);
  for (int i = 0; i < scaling.cameras; ++i) {
    offs[i] = hn::And(difference_from(samples[i], mean), seen[i]);
    most = hn::Max(most, offs[i]);
  }
  auto waiting = hn::VecFromMask(d, hn::Gt(mean.count, codes(2)));
  for (int i = 0; i < scaling.cameras; ++i) {
    const auto worst = hn::VecFromMask(d, hn::Eq(offs[i], most));
    const auto excluded_cameras = hn::And(hn::And(worst, seen[i]), waiting);
    waiting = hn::AndNot(excluded_cameras, waiting);
    seen[i] = hn::AndNot(excluded_cameras, seen[i]);
    samples[i] = {hn::And(samples[i].red, seen[i]), hn::And(samples[i].green, seen[i]),
                  hn::And(samples[i].blue, seen[i])};
  }
}

template <bool kAllSeen>
HWY_INLINE void compare(const CostScale& scaling, const Samples* samples, const Codes* seen,
                        std::uint8_t* costs) {
  const CodeTag d;
  const hn::RebindToSigned<CodeTag> di;
  const hn::Rebind<std::uint8_t, CodeTag> d8;
  const Mean mean = mean_of<kAllSeen>(scaling, samples, seen);
  const auto truncation = codes(scaling.truncation);
  auto sum = hn::Zero(d);
  for (int i = 0; i < scaling.cameras; ++i) {
    const auto cut =
        hn::Min(hn::ShiftRightSame(difference_from(samples[i], mean), scaling.right), truncation);
    sum = hn::Add(sum, kAllSeen ? cut : hn::And(cut, seen[i]));
  }
  sum = hn::ShiftLeftSame(sum, scaling.left);
  auto cost = hn::ShiftRight<4>(hn::Add(hn::MulHigh(sum, mean.scale), codes(8)));
  if (!kAllSeen)
    cost = hn::IfThenElse(hn::Lt(mean.count, codes(2)), codes(matching::kUnknownCost), cost);
  hn::StoreU(hn::DemoteTo(d8, hn::BitCast(di, cost)), d8, costs);
}

/// Writes costs of a block's `count` pixels: kCostBlockSize bytes per plane, in join()'s order.
void fill_planes(const CostRun& run, int begin, int count, CostScratch& scratch) {
  const FloatTag d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const CostScale scaling(run);
  std::array<Camera, kMaxMatchedCameras> cameras;
  bool all_fitted = true;
  for (std::size_t i = 0; i < run.cameras.size(); ++i) {
    Camera& camera = cameras[i];
    const MatchingFrame& frame = *run.cameras[i]->frame;
    camera.projection = BlockProjection(*run.cameras[i], run, begin, count);
    camera.positions = scratch.positions(static_cast<int>(i));
    camera.origin = Row{frame.words() + camera.projection.column(), frame.pitch()}.below(
        camera.projection.row());
    all_fitted &= PositionFit(camera.projection, count).fit(run.planes.count, camera.positions);
  }
  const auto last = hn::Set(d, static_cast<float>(count - 1));
  std::array<Samples, kMaxMatchedCameras> samples;
  std::array<Codes, kMaxMatchedCameras> seen;
  for (int plane = 0; plane < run.planes.count; ++plane) {
    std::uint8_t* costs = scratch.costs() + static_cast<std::ptrdiff_t>(plane) * kCostBlockSize;
    for (int x = 0; x < count; x += 2 * lanes) {
      const Pixels pixels{hn::Min(hn::Iota(d, static_cast<float>(x)), last),
                          hn::Min(hn::Iota(d, static_cast<float>(x + lanes)), last), x / lanes};
      if (all_fitted && run.cameras.size() > 1 && run.excluded_cameras == 0) {
        for (std::size_t i = 0; i < run.cameras.size(); ++i) {
          samples[i] = sample_fitted(cameras[i], pixels, plane);
        }
        compare<true>(scaling, samples.data(), seen.data(), costs + x);
        continue;
      }
      for (std::size_t i = 0; i < run.cameras.size(); ++i) {
        if (cameras[i].positions.fitted[plane] == 0) {
          samples[i] = sample_exactly(cameras[i], pixels, plane, seen[i]);
        } else {
          samples[i] = sample_fitted(cameras[i], pixels, plane);
          seen[i] = hn::Set(CodeTag(), 0xFFFF);
        }
      }
      for (int i = 0; i < run.excluded_cameras; ++i)
        exclude_worst(scaling, samples.data(), seen.data());
      compare<false>(scaling, samples.data(), seen.data(), costs + x);
    }
  }
}

void transpose(const CostScratch& scratch, int count, int stride, std::uint8_t* out) {
  constexpr int kSide = 16;
  const hn::FixedTag<std::uint8_t, kSide> d;
  using Bytes = hn::Vec<decltype(d)>;
  const int lanes = static_cast<int>(hn::Lanes(FloatTag()));
  for (int plane = 0; plane < stride; plane += kSide) {
    for (int first = 0; first < kCostBlockSize; first += kSide) {
      Bytes rows[kSide], mixed[kSide];
      for (int i = 0; i < kSide; ++i) {
        rows[i] = hn::LoadU(d, scratch.costs() + (plane + i) * kCostBlockSize + first);
      }
      for (int round = 0; round < 4; ++round) {  // each doubles the consecutive bytes of a pixel
        for (int i = 0; i < kSide / 2; ++i) {
          mixed[2 * i] = hn::InterleaveLower(d, rows[i], rows[i + kSide / 2]);
          mixed[2 * i + 1] = hn::InterleaveUpper(d, rows[i], rows[i + kSide / 2]);
        }
        std::copy(mixed, mixed + kSide, rows);
      }
      for (int i = 0; i < kSide; ++i) {
        const int group = (first + i) / (2 * lanes) * (2 * lanes), lane = (first + i) - group;
        const int x = group + lane / 2 + (lane % 2) * lanes;
        if (x < count)
          hn::StoreU(rows[i], d, out + static_cast<std::ptrdiff_t>(x) * stride + plane);
      }
    }
  }
}

void fill(const CostRun& run, CostScratch& scratch) {
  const int stride = matching::plane_stride(run.planes.count);
  for (int begin = run.begin; begin < run.end; begin += kCostBlockSize) {
    const int count = std::min(kCostBlockSize, run.end - begin);
    fill_planes(run, begin, count, scratch);
    transpose(scratch, count, stride,
              run.costs + static_cast<std::ptrdiff_t>(begin - run.begin) * stride);
  }
}

const char* target() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace raystage::render
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raystage::render {

HWY_EXPORT(fill);
HWY_EXPORT(target);

CostScratch::CostScratch(int planes, int cameras)
    : stride_(static_cast<std::size_t>(matching::plane_stride(planes))),
      coefficients_((5 + kMaxParts) * static_cast<std::size_t>(cameras) * stride_),
      fitted_(static_cast<std::size_t>(cameras) * stride_),
      columns_(kMaxParts * cameras * stride_),
      rows_(columns_.size()),
      costs_(kCostBlockSize * stride_) {}

void compute_matching_costs(const CostRun& run, CostScratch& scratch) {
  HWY_DYNAMIC_DISPATCH(fill)(run, scratch);
}
const char* cost_kernel_target() { return HWY_DYNAMIC_DISPATCH(target)(); }

}  // namespace raystage::render
#endif
