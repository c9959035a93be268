// SPDX-License-Identifier: Apache-2.0
#include "render/slabs/node_rows.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>

namespace raystage::render {
namespace {

constexpr int kNodeWidth = 37, kNodeHeight = 23;

double value_at(const SlabRun::LinearFunction& function, int x, int y) {
  return function[0] * (x + 0.5) + function[1] * (y + 0.5) + function[2];
}

/// Expects that `rows` contains all samples of the node's image that are read at (u, v) with a
/// weight: the four samples around, as SlabInterpolation defines, pixel by pixel.
void expect_holds_what_is_read(const SlabRun& run, int corner, const NodeRows& rows) {
  const auto right = static_cast<std::size_t>(corner & 1),
             lower = static_cast<std::size_t>(corner / 2);
  for (int x = run.begin; x < run.end; ++x) {
    const double ahead = value_at(run.ahead, x, run.y);
    if (!(ahead > 0)) continue;
    const double across = value_at(run.across, x, run.y);
    const double column = value_at(run.column, x, run.y) / across;
    const double row = value_at(run.row, x, run.y) / across;
    const bool nearest = run.interpolation == SlabInterpolation::kNearest;
    if (nearest && ((column >= 0.5) != (right == 1) || (row >= 0.5) != (lower == 1))) continue;
    const double u = value_at(run.u[right], x, run.y) / ahead;
    const double v = value_at(run.v[lower], x, run.y) / ahead;
    if (!(u > 0 && u < kNodeWidth && v > 0 && v < kNodeHeight)) continue;
    const double left = std::max(u - 0.5, 0.0), upper = std::max(v - 0.5, 0.0);
    const auto last = [](double first, int size) {
      return std::min(static_cast<int>(std::ceil(first)), size - 1);
    };
    for (int sy = static_cast<int>(upper); sy <= last(upper, kNodeHeight); ++sy) {
      RC_ASSERT(rows.row(sy).begin <= static_cast<int>(left));
      RC_ASSERT(rows.row(sy).end > last(left, kNodeWidth));
    }
  }
}

TEST(NodeRows, HoldWhatIsReadAndLittleMore) {
  rc::check("every sample that counts is in", [] {
    const auto number = [](double most) {
      return *rc::gen::map(rc::gen::inRange(-100000, 100001),
                           [most](int i) { return i * most / 100000; });
    };
    SlabRun run;
    run.begin = *rc::gen::inRange(0, 50);
    run.end = run.begin + *rc::gen::inRange(1, 100);
    run.y = *rc::gen::inRange(0, 80);
    run.interpolation =
        *rc::gen::element(SlabInterpolation::kQuadrilinear, SlabInterpolation::kBilinearNodes,
                          SlabInterpolation::kNearest);
    run.across = {number(1e-3), number(1e-3), 1};
    run.column = {number(0.01), number(0.01), number(1)};
    run.row = {number(0.01), number(0.01), number(1)};
    run.ahead = {number(0.02), number(0.02), number(2)};  // may fall to 0 within the run
    for (auto& u : run.u) u = {number(2), number(2), number(60)};
    for (auto& v : run.v) v = {number(2), number(2), number(40)};
    for (int corner = 0; corner < 4; ++corner) {
      NodeRows rows(kNodeWidth, kNodeHeight);
      rows.add(run, corner);
      expect_holds_what_is_read(run, corner, rows);
      RC_ASSERT(NodeRows::all(kNodeWidth, kNodeHeight).covers(rows));
    }
  });
}

TEST(NodeRows, AreTightForARunAlongARow) {
  SlabRun run;
  run.begin = 3;
  run.end = 23;
  run.across = run.ahead = {0, 0, 1};
  run.u = {SlabRun::LinearFunction{1, 0, 2.25}, SlabRun::LinearFunction{1, 0, -100}};
  run.v = {SlabRun::LinearFunction{0, 0, 7.75}, SlabRun::LinearFunction{0, 0, 7.75}};
  NodeRows rows(kNodeWidth, kNodeHeight);
  rows.add(run, 0);
  for (int y = 0; y < kNodeHeight; ++y) {
    const bool is_read = y == 7 || y == 8;
    EXPECT_EQ(rows.row(y).is_empty(), !is_read) << y;
    if (!is_read) continue;
    EXPECT_EQ(rows.row(y).begin, 5);  // u = 5.75 to 24.75, half a sample and one more around
    EXPECT_EQ(rows.row(y).end, 26);
  }
  NodeRows outside(kNodeWidth, kNodeHeight);
  outside.add(run, 1);
  EXPECT_TRUE(rows.covers(outside));
  EXPECT_TRUE(NodeRows(kNodeWidth, kNodeHeight).covers(outside));
  EXPECT_FALSE(outside.covers(rows));
  EXPECT_FALSE(rows.is_whole());
  EXPECT_TRUE(NodeRows::all(kNodeWidth, kNodeHeight).is_whole());
}

TEST(NodeRows, OfTheNearestNodeAloneHoldOnlyTheRaysNearToIt) {
  SlabRun run;
  run.begin = 0;
  run.end = 32;
  run.interpolation = SlabInterpolation::kNearest;
  run.across = run.ahead = {0, 0, 1};
  run.column = {1.0 / 32, 0, 0};
  run.u = {SlabRun::LinearFunction{1, 0, 0}, SlabRun::LinearFunction{1, 0, 0}};
  run.v = {SlabRun::LinearFunction{0, 0, 5}, SlabRun::LinearFunction{0, 0, 5}};
  NodeRows left(kNodeWidth, kNodeHeight), right(kNodeWidth, kNodeHeight),
      lower(kNodeWidth, kNodeHeight);
  left.add(run, 0);
  right.add(run, 1);
  lower.add(run, 2);
  EXPECT_EQ(left.row(5).begin, 0);
  EXPECT_EQ(left.row(5).end, 17);
  EXPECT_EQ(right.row(5).begin, 15);
  EXPECT_EQ(right.row(5).end, 33);
  EXPECT_TRUE(NodeRows(kNodeWidth, kNodeHeight).covers(lower));
}

}  // namespace
}  // namespace raystage::render
