// SPDX-License-Identifier: Apache-2.0
// Marks the MCUs that a block of the view may read at any depth within a range. Projects the
// block's corners at both ends of the range and divides their motion into pieces of 16 pixels.
// Bounds each piece through the lens by interval arithmetic, so that never too little is marked.
// Input: DepthSource, ViewBlock. Cost: pieces per block, independent of its pixels.

#include "render/sampling/depth_planning.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "render/sampling/fisheye_footprint.h"

namespace raystage::render {
namespace {

/// The interval of all numbers from `low` to `high`.
struct Interval {
  double low = 0, high = 0;
};
Interval operator+(Interval a, Interval b) { return {a.low + b.low, a.high + b.high}; }
Interval operator*(double s, Interval a) {
  return s < 0 ? Interval{s * a.high, s * a.low} : Interval{s * a.low, s * a.high};
}
Interval operator*(Interval a, Interval b) {
  const auto [low, high] =
      std::minmax({a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high});
  return {low, high};
}
Interval square(Interval a) {
  const double low = a.low * a.low, high = a.high * a.high;
  if (a.low <= 0 && a.high >= 0) return {0, std::max(low, high)};
  return {std::min(low, high), std::max(low, high)};
}
Interval joined(Interval a, Interval b) {
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

/// Bounds an image region after lens distortion by interval arithmetic: never too small.
struct Region {
  Interval x, y;
};
Region project_through_lens(const SourceView& c, Region ideal) {
  Region pixels = ideal;
  if (c.distorted) {
    const Interval xx = square(ideal.x), yy = square(ideal.y);
    Interval rr = xx + yy;
    // Points beyond the limit of the lens model are not visible.
    rr.high = std::min(rr.high, static_cast<double>(c.fold_radius_squared));
    rr.low = std::min(rr.low, rr.high);
    Interval radial = rr * Interval{c.k3, c.k3} + Interval{c.k2, c.k2};
    radial = rr * radial + Interval{c.k1, c.k1};
    radial = rr * radial + Interval{1, 1};
    const Interval xy = ideal.x * ideal.y;
    pixels.x = ideal.x * radial + (2.0 * c.p1) * xy + static_cast<double>(c.p2) * (rr + 2 * xx);
    pixels.y = ideal.y * radial + (2.0 * c.p2) * xy + static_cast<double>(c.p1) * (rr + 2 * yy);
  }
  return {c.fx * pixels.x + Interval{c.cx, c.cx}, c.fy * pixels.y + Interval{c.cy, c.cy}};
}

/// Marks the MCUs that hold pixels [left, right] x [top, bottom], clipped to the frame.
void mark_pixels(const SourceView& c, double left, double right, double top, double bottom) {
  if (!(right >= 0 && bottom >= 0 && left <= c.width - 1 && top <= c.height - 1)) return;
  const auto clipped = [](double at, int size) {
    return static_cast<int>(std::clamp(at, 0.0, size - 1.0));
  };
  const int first_column = clipped(left, c.width) >> c.mcu_width_log2;
  const int last_column = clipped(right, c.width) >> c.mcu_width_log2;
  const int first_row = clipped(top, c.height) >> c.mcu_height_log2;
  const int last_row = clipped(bottom, c.height) >> c.mcu_height_log2;
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      mark_mcu(c.wanted_mcus, row * c.mcus_per_row + column);
    }
  }
}

/// Returns the directions (x right, y down, z ahead) of the block's four corners at one depth.
std::array<Eigen::Vector3d, 4> directions_at(const DepthSource& source, const ViewBlock& block,
                                             double inverse_depth) {
  std::array<Eigen::Vector3d, 4> directions;
  const auto& m = source.camera.ideal_from_pixel;
  for (std::size_t i = 0; i < 4; ++i) {
    const double x = (i & 1) ? block.right - 0.5 : block.left + 0.5;
    const double y = (i & 2) ? block.bottom - 0.5 : block.top + 0.5;
    const auto row = [&](std::size_t r) {
      return m[3 * r] * x + m[3 * r + 1] * y + m[3 * r + 2] +
             inverse_depth * source.per_inverse_depth[r];
    };
    directions[i] = {row(0), row(1), row(2)};
  }
  return directions;
}

/// The ideal image points of the block's four corners at one depth.
struct Corners {
  std::array<double, 4> x{}, y{};
  int in_front = 0;
};
Corners corners_at(const DepthSource& source, const ViewBlock& block, double inverse_depth) {
  Corners corners;
  const auto directions = directions_at(source, block, inverse_depth);
  for (std::size_t i = 0; i < 4; ++i) {
    const double w = directions[i].z();
    if (!(w > 0)) continue;
    ++corners.in_front;
    corners.x[i] = directions[i].x() / w;
    corners.y[i] = directions[i].y() / w;
  }
  return corners;
}

/// From far to near, corners move along a line in the image. Pieces avoid one large rectangle
/// around a slanted line.
constexpr double kPieceLength = 16;  // pixels
constexpr int kMaxPieces = 256;

int pieces_of(double longest) {
  return 1 + static_cast<int>(std::min<double>(kMaxPieces - 1, longest / kPieceLength));
}
double depth_of_piece(const ViewBlock& block, int piece, int pieces) {
  if (piece == pieces) return block.nearest;
  const double part = static_cast<double>(piece) / pieces;
  return (1 - part) * block.farthest + part * block.nearest;
}

/// Marks what the interpolation reads about the positions in a region of the frame.
void mark_region(const SourceView& c, const Region& pixels, Interpolation interpolation) {
  // Exceeds the rounding errors of the kernels, which compute in float (pixels).
  const double slack = 0.25;
  const double before =
      (interpolation == Interpolation::kCubic ? 1.5 : 0.5) + c.chroma_radius + slack;
  const double behind = (interpolation == Interpolation::kCubic ? 2 : 1) + c.chroma_radius + slack;
  if (pixels.x.high >= -slack && pixels.x.low <= c.width + slack && pixels.y.high >= -slack &&
      pixels.y.low <= c.height + slack) {
    // Beyond the outermost pixel centres the outermost pixels are read.
    const double left = std::clamp(pixels.x.low, 0.5, c.width - 0.5);
    const double right = std::clamp(pixels.x.high, 0.5, c.width - 0.5);
    const double top = std::clamp(pixels.y.low, 0.5, c.height - 0.5);
    const double bottom = std::clamp(pixels.y.high, 0.5, c.height - 0.5);
    mark_pixels(c, left - 0.5 - before, right - 0.5 + behind, top - 0.5 - before,
                bottom - 0.5 + behind);
  }
}

/// Bounds the positions in a fisheye of a piece of a block between two of its depths.
FisheyeFootprint footprint_of_piece(const DepthSource& source, const ViewBlock& block,
                                    double farther, double nearer) {
  std::array<Eigen::Vector3d, 8> corners;
  std::ranges::copy(directions_at(source, block, farther), corners.begin());
  std::ranges::copy(directions_at(source, block, nearer), corners.begin() + 4);
  return fisheye_footprint(source.camera, corners, false);
}

/// As mark_block(), in a fisheye. Blocks of which the bound is loose are halved.
void mark_in_fisheye(const DepthSource& source, const ViewBlock& block,
                     Interpolation interpolation) {
  constexpr double kLoose = 2;      // pixels
  constexpr int kSmallestSide = 4;  // pixels of the view
  const SourceView& c = source.camera;
  const auto far = directions_at(source, block, block.farthest);
  const auto near = directions_at(source, block, block.nearest);
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d moved = fisheye_position(c, near[i]) - fisheye_position(c, far[i]);
    longest = std::max(longest, moved.cwiseAbs().maxCoeff());
  }
  const int pieces = pieces_of(longest);
  std::vector<FisheyeFootprint> footprints;
  bool is_loose = false;
  for (int piece = 1; piece <= pieces; ++piece) {
    const double farther = piece == 1 ? block.farthest : depth_of_piece(block, piece - 1, pieces);
    footprints.push_back(
        footprint_of_piece(source, block, farther, depth_of_piece(block, piece, pieces)));
    using Place = FisheyeFootprint::Place;
    const FisheyeFootprint& found = footprints.back();
    is_loose = is_loose || found.place == Place::kUnclear ||
               (found.place == Place::kSeen && found.margin > kLoose);
  }
  const int columns = block.right - block.left, rows = block.bottom - block.top;
  if (is_loose && std::max(columns, rows) > kSmallestSide) {
    ViewBlock first = block, second = block;
    if (columns >= rows) {
      first.right = second.left = block.left + columns / 2;
    } else {
      first.bottom = second.top = block.top + rows / 2;
    }
    mark_in_fisheye(source, first, interpolation);
    mark_in_fisheye(source, second, interpolation);
    return;
  }
  for (const FisheyeFootprint& found : footprints) {
    if (found.place == FisheyeFootprint::Place::kUnclear) {
      mark_pixels(c, 0, c.width - 1, 0, c.height - 1);
    } else if (found.place == FisheyeFootprint::Place::kSeen) {
      mark_region(c, {{found.left, found.right}, {found.top, found.bottom}}, interpolation);
    }
  }
}

}  // namespace

void mark_block(const DepthSource& source, const ViewBlock& block, Interpolation interpolation) {
  const SourceView& c = source.camera;
  if (c.is_fisheye) {
    mark_in_fisheye(source, block, interpolation);
    return;
  }
  const Corners far = corners_at(source, block, block.farthest);
  const Corners near = corners_at(source, block, block.nearest);
  if (far.in_front + near.in_front == 0) return;  // W is linear
  if (far.in_front + near.in_front < 8) {
    mark_pixels(c, 0, c.width - 1, 0, c.height - 1);
    return;
  }
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    longest = std::max(
        {longest, c.fx * std::abs(near.x[i] - far.x[i]), c.fy * std::abs(near.y[i] - far.y[i])});
  }
  const int pieces = pieces_of(longest);
  Corners from = far;
  for (int piece = 1; piece <= pieces; ++piece) {
    const Corners to = corners_at(source, block, depth_of_piece(block, piece, pieces));
    const auto range = [](const std::array<double, 4>& values) {
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      return Interval{*low, *high};
    };
    // The hull of the corners contains the piece, because projections preserve lines.
    const Region pixels = project_through_lens(
        c, {joined(range(from.x), range(to.x)), joined(range(from.y), range(to.y))});
    mark_region(c, pixels, interpolation);
    from = to;
  }
}

}  // namespace raystage::render
