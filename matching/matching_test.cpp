// SPDX-License-Identifier: Apache-2.0
#include "matching/matching.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <random>
#include <stdexcept>

#include "base/large_buffer.h"
#include "matching/path_kernels.h"
#include "testing/test_simd_targets.h"

namespace raystage::matching {
namespace {

/// Random costs with planes that agree over parts of a row, so that paths matter. Elements between
/// the planes and the stride have costs that would be chosen by mistake.
struct RandomCosts {
  RandomCosts(const CostVolume& of, unsigned seed) : volume(of) {
    std::mt19937 random(seed);
    const int stride = plane_stride(of.planes);
    for (int y = 0; y < of.height; ++y) {
      int true_plane = 0;
      for (int x = 0; x < of.width; ++x) {
        if (x % 7 == 0) true_plane = static_cast<int>(random() % static_cast<unsigned>(of.planes));
        for (int plane = 0; plane < stride; ++plane) {
          const unsigned most = plane == true_plane ? 90 : 256;
          costs.push_back(plane < of.planes ? static_cast<std::uint8_t>(random() % most)
                                            : std::uint8_t{0});
        }
      }
    }
    for (int i = 0; i < of.width * of.height; ++i) {
      guide.push_back(static_cast<std::uint8_t>(random() % 60));
    }
  }
  FillCosts fill() const {
    return [this](int y, std::span<std::uint8_t> row) {
      const auto first = costs.begin() + static_cast<std::ptrdiff_t>(row.size()) * y;
      std::copy_n(first, row.size(), row.begin());
    };
  }
  CostVolume volume;
  std::vector<std::uint8_t> costs, guide;
};

void expect_equal(const PlaneMap& a, const PlaneMap& b) {
  ASSERT_EQ(a.plane.size(), b.plane.size());
  EXPECT_EQ(a.plane, b.plane);
  EXPECT_EQ(a.cost, b.cost);
}

const std::vector<CostVolume> kShapes{{1, 1, 1},     {1, 9, 5},     {23, 1, 8},   {40, 30, 1},
                                      {37, 29, 2},   {33, 21, 31},  {19, 40, 32}, {70, 35, 33},
                                      {130, 50, 64}, {25, 18, 100}, {9, 20, 512}};

TEST(Matching, SemiGlobalIsTheReferenceToTheBit) {
  testing::for_each_simd_target(matching_target, [] {
    for (const CostVolume& volume : kShapes) {
      SCOPED_TRACE(volume.planes);
      const RandomCosts costs(volume, 1);
      SemiGlobalOptions options;
      expect_equal(semi_global_match(volume, costs.fill(), options),
                   semi_global_match_reference(volume, costs.fill(), options));
      options.guide = costs.guide;
      options.p1 = 7;
      options.p2 = 4000;
      options.subplane_refinement = false;
      expect_equal(semi_global_match(volume, costs.fill(), options),
                   semi_global_match_reference(volume, costs.fill(), options));
    }
  });
}

TEST(Matching, BoxIsTheReferenceToTheBit) {
  testing::for_each_simd_target(matching_target, [] {
    for (const CostVolume& volume : kShapes) {
      SCOPED_TRACE(volume.planes);
      const RandomCosts costs(volume, 2);
      for (const int radius : {0, 1, 2, 7}) {
        expect_equal(box_match(volume, costs.fill(), radius, radius != 1),
                     box_match_reference(volume, costs.fill(), radius, radius != 1));
      }
    }
  });
}

TEST(Matching, LittleMemoryAndManyThreadsChangeNothing) {
  const CostVolume volume{90, 133, 40};
  const RandomCosts costs(volume, 3);
  SemiGlobalOptions options;
  options.guide = costs.guide;
  const PlaneMap expected = semi_global_match_reference(volume, costs.fill(), options);
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    for (const std::size_t bytes : {std::size_t{0}, std::size_t{900'000}, std::size_t{1} << 30}) {
      options.working_bytes = bytes;
      expect_equal(semi_global_match(volume, costs.fill(), options), expected);
    }
    expect_equal(box_match(volume, costs.fill(), 2, true),
                 box_match_reference(volume, costs.fill(), 2, true));
  }
}

TEST(Matching, WorksInTheMemoryThatItIsGivenOrInTheLeast) {
  const CostVolume volume{1920, 1080, 512};
  constexpr std::size_t kAll = std::size_t{1} << 40, kMega = 1'000'000;
  EXPECT_GT(semi_global_bytes(volume, kAll), std::size_t{3} * 1920 * 1080 * 512);
  EXPECT_LE(semi_global_bytes(volume, 1000 * kMega), 1000 * kMega);
  EXPECT_LE(semi_global_bytes(volume, 400 * kMega), 400 * kMega);
  // More strips need more memory for entering paths than they save for costs.
  const std::size_t least = semi_global_bytes(volume, 0);
  EXPECT_LT(least, 300 * kMega);
  for (std::size_t bytes = least; bytes < 3 * least; bytes += least / 10) {
    EXPECT_LE(semi_global_bytes(volume, bytes), bytes);
  }
}

TEST(Matching, PathsCarryAPlaneThroughPixelsThatDoNotTell) {
  const CostVolume volume{40, 20, 16};
  const FillCosts fill = [&](int y, std::span<std::uint8_t> row) {
    std::fill(row.begin(), row.end(), std::uint8_t{100});
    for (int x = 0; x < volume.width; ++x) {
      const int plane = x < 20 ? 3 : 11;  // a step edge, with texture on every third pixel
      if ((x + y) % 3 == 0) row[x * 32 + plane] = 0;
    }
  };
  SemiGlobalOptions options;
  options.subplane_refinement = false;
  const PlaneMap found = semi_global_match(volume, fill, options);
  int wrong = 0;
  for (int y = 0; y < volume.height; ++y) {
    for (int x = 0; x < volume.width; ++x) {
      if (x >= 18 && x < 22) continue;  // at the step, both planes are correct
      wrong += found.plane[y * volume.width + x] != (x < 20 ? 3 : 11);
    }
  }
  EXPECT_EQ(wrong, 0);
  const PlaneMap alone = box_match(volume, fill, 0, false);
  EXPECT_EQ(alone.plane[1], 0);  // not determined there
}

TEST(Matching, ParabolaFindsTheVertexBetweenPlanes) {
  EXPECT_FLOAT_EQ(parabola_vertex(9, 1, 1), 0.5F);
  EXPECT_FLOAT_EQ(parabola_vertex(1, 1, 9), -0.5F);
  EXPECT_FLOAT_EQ(parabola_vertex(5, 5, 5), 0);
  EXPECT_FLOAT_EQ(parabola_vertex(10, 2, 4), 0.3F);  // 5 (x - 0.3)^2 + ...
}

TEST(Matching, TakesItsMemoryFromThePoolAndLeavesItThere) {
  const CostVolume volume{640, 480, 32};
  const FillCosts fill = [](int y, std::span<std::uint8_t> row) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      row[i] = static_cast<std::uint8_t>(i * 37 + static_cast<std::size_t>(y) * 11);
    }
  };
  const PlaneMap fresh = semi_global_match(volume, fill, {});
  BufferPool buffers;
  SemiGlobalOptions options;
  options.buffers = &buffers;
  std::size_t left = 0;
  for (int again = 0; again < 3; ++again) {  // also with the previous contents of the buffers
    EXPECT_EQ(semi_global_match(volume, fill, options).plane, fresh.plane);
    if (again == 0) left = buffers.free_bytes();
    EXPECT_EQ(buffers.free_bytes(), left);
  }
  EXPECT_GE(left, std::size_t{3} * 640 * 480 * 32);
  EXPECT_LE(left, semi_global_bytes(volume, options.working_bytes));
}

TEST(BufferPool, HoldsWhatFitsAndFreesTheRest) {
  BufferPool pool;
  const int* first = nullptr;
  {
    const LargeBuffer<int> a(1 << 21, &pool), b(1 << 21, &pool);
    first = b.data();
    a.data()[0] = b.data()[(1 << 21) - 1] = 1;
    EXPECT_EQ(pool.free_bytes(), 0U);
  }
  EXPECT_EQ(pool.free_bytes(), std::size_t{2} << 23);
  {
    const LargeBuffer<int> again(1 << 21, &pool);
    EXPECT_EQ(again.data(), first);
    EXPECT_EQ(pool.free_bytes(), std::size_t{1} << 23);
    const LargeBuffer<int> other(1 << 20, &pool);  // of another size
    EXPECT_EQ(pool.free_bytes(), 0U);
  }
  pool.release();
  EXPECT_EQ(pool.free_bytes(), 0U);
}

TEST(Matching, RefusesSettingsOutOfRange) {
  const FillCosts none = [](int, std::span<std::uint8_t>) {};
  SemiGlobalOptions options;
  EXPECT_THROW(semi_global_match({0, 1, 1}, none, options), std::logic_error);
  EXPECT_THROW(box_match({4, 4, 4}, none, 8, false), std::logic_error);
  options.p2 = options.p1 - 1;
  EXPECT_THROW(semi_global_match({4, 4, 4}, none, options), std::logic_error);
}

}  // namespace
}  // namespace raystage::matching
