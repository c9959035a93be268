// SPDX-License-Identifier: Apache-2.0
// Bounds the samples of a node's image that runs of pixels read: one interval of columns per row.
// Positions (u, v) / ahead are monotone along a run, so that its two ends bound them by a box. Runs
// of more than kPixelsPerBox pixels whose box has more than kRowsPerBox rows are halved. Output:
// all samples that sample_slab_run() reads, and few more. Cost: O(boxes x rows of a box).
#include "render/slabs/node_rows.h"

#include <algorithm>
#include <cmath>

namespace raystage::render {
namespace {

/// Pixels of the view whose samples are bounded by one box. Runs may be longer if their samples lie
/// within kRowsPerBox rows of the image.
constexpr int kPixelsPerBox = 16, kRowsPerBox = 3;

/// Maximum difference from the kernels' positions, in samples.
constexpr double kRounding = 1.0 / 16;

/// Weight that rounding may add to a node.
constexpr double kShareRounding = 1e-3;

double value(const SlabRun::LinearFunction& function, double x, int y) {
  return function[0] * x + (function[1] * (y + 0.5) + function[2]);
}

/// Returns whether the second (or first) of two nodes along an axis has weight anywhere between two
/// rays.
bool counts(const SlabRun& run, const SlabRun::LinearFunction& times, bool second, double x0,
            double x1) {
  if (run.interpolation != SlabInterpolation::kNearest) return true;
  const double share0 = value(times, x0, run.y) / value(run.across, x0, run.y);
  const double share1 = value(times, x1, run.y) / value(run.across, x1, run.y);
  if (!std::isfinite(share0) || !std::isfinite(share1)) return true;
  return second ? std::max(share0, share1) >= 0.5 - kShareRounding
                : std::min(share0, share1) < 0.5 + kShareRounding;
}

/// Returns the samples that positions from `a` to `b` read; empty where all are outside.
NodeRows::Span samples(double a, double b, int size) {
  const double first = std::min(a, b) - kRounding, last = std::max(a, b) + kRounding;
  if (!(last > 0) || !(first < size)) return {};
  const double inside = std::max(first - 0.5, 0.0), end = std::min<double>(last + 0.5, size - 1);
  return {static_cast<int>(inside), static_cast<int>(end) + 1};
}

}  // namespace

NodeRows NodeRows::all(int width, int height) {
  NodeRows rows(width, height);
  std::ranges::fill(rows.spans_, Span{0, width});
  return rows;
}

bool NodeRows::covers(const NodeRows& other) const {
  for (std::size_t y = 0; y < spans_.size(); ++y) {
    const Span &mine = spans_[y], &theirs = other.spans_[y];
    if (theirs.is_empty()) continue;
    if (mine.begin > theirs.begin || mine.end < theirs.end) return false;
  }
  return true;
}

bool NodeRows::is_whole() const {
  return std::ranges::all_of(
      spans_, [&](const Span& span) { return span.begin <= 0 && span.end >= width_; });
}

void NodeRows::add(const SlabRun& run, int corner) {
  if (run.begin < run.end) add_piece(run, corner, run.begin, run.end);
}

void NodeRows::add_piece(const SlabRun& run, int corner, int begin, int end) {
  const double x0 = begin + 0.5, x1 = end - 0.5;
  const double ahead0 = value(run.ahead, x0, run.y), ahead1 = value(run.ahead, x1, run.y);
  if (!(ahead0 > 0) && !(ahead1 > 0)) return;  // linear: not visible in between either
  const bool is_long = end - begin > kPixelsPerBox;
  const auto halve = [&] {
    const int middle = begin + (end - begin) / 2;
    add_piece(run, corner, begin, middle);
    add_piece(run, corner, middle, end);
  };
  if (!(ahead0 > 0) || !(ahead1 > 0)) return halve();
  if (is_long && run.interpolation == SlabInterpolation::kNearest) return halve();
  const bool right = (corner & 1) != 0, lower = (corner & 2) != 0;
  if (!counts(run, run.column, right, x0, x1) || !counts(run, run.row, lower, x0, x1)) return;
  const auto &u = run.u[right ? 1 : 0], &v = run.v[lower ? 1 : 0];
  const Span columns = samples(value(u, x0, run.y) / ahead0, value(u, x1, run.y) / ahead1, width_);
  const Span rows = samples(value(v, x0, run.y) / ahead0, value(v, x1, run.y) / ahead1, height());
  if (is_long && rows.end - rows.begin > kRowsPerBox) return halve();
  if (columns.is_empty()) return;
  for (int y = rows.begin; y < rows.end; ++y) {
    Span& span = spans_[y];
    span = span.is_empty()
               ? columns
               : Span{std::min(span.begin, columns.begin), std::max(span.end, columns.end)};
  }
}

}  // namespace raystage::render
