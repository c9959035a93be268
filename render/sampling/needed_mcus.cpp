// SPDX-License-Identifier: Apache-2.0
// Marks the MCUs that a block of the view may read on a plane: all that mark_run() marks. Bounds
// the projected quadrilateral by a box, enlarged by a bound of the lens distortion's second
// derivative (see needed_mcus.h). Blocks that are large or cross the horizon are halved. Cost:
// constant per block.

#include "render/sampling/needed_mcus.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "render/sampling/fisheye_footprint.h"

namespace raystage::render {
namespace {

/// Exceeds the rounding error of positions in the kernels, in pixels.
constexpr double kRounding = 0.5;

struct Point {
  double x = 0, y = 0;
};

/// Distorts a point as CameraModel::pixel_from_ideal() (Brown-Conrady), but beyond the model's
/// limit too.
Point project_through_lens(const SourceView& s, Point p) {
  const double xx = p.x * p.x, yy = p.y * p.y, xy2 = 2 * p.x * p.y, rr = xx + yy;
  const double radial = 1 + rr * (s.k1 + rr * (s.k2 + rr * s.k3));
  return {p.x * radial + s.p1 * xy2 + s.p2 * (rr + 2 * xx),
          p.y * radial + s.p2 * xy2 + s.p1 * (rr + 2 * yy)};
}

/// Bounds the distortion's second derivative within a radius. A homogeneous polynomial of degree n
/// that is at most 1 on the unit circle has the bound n (n - 1) r^(n - 2).
double bend(const SourceView& s, double radius) {
  const double rr = radius * radius;
  const auto size = [](float k) { return static_cast<double>(std::abs(k)); };
  return radius * (6 * size(s.k1) + rr * (20 * size(s.k2) + rr * 42 * size(s.k3))) +
         6 * (size(s.p1) + size(s.p2));
}

/// The box in the frame, in pixels, in which a block is sampled.
struct Box {
  double left = 0, right = 0, top = 0, bottom = 0;
  double area() const { return (right - left) * (bottom - top); }
};

/// The projection of a block into a camera.
struct Footprint {
  enum class Place { kUnseen, kAhead, kUnclear } place = Place::kUnseen;
  Box box;             ///< for kAhead: around the samples, partly within the frame
  double area = 0;     ///< of the part within the box
  double spacing = 0;  ///< largest, between samples
};

/// Returns the pixel centres at the corners of a block, in order.
std::array<Point, 4> corners_of(const PixelBlock& block) {
  const double x0 = block.x_begin + 0.5, x1 = block.x_end - 0.5;
  const double y0 = block.y_begin + 0.5, y1 = block.y_end - 0.5;
  return {Point{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

double distance(const Point& a, const Point& b) {
  return std::sqrt((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y));
}

/// Completes a footprint from the block's corners in the frame, pixels, and the margin about them.
void enclose(const SourceView& s, const PixelBlock& block, const std::array<Point, 4>& corner,
             double margin, Footprint& out) {
  using Place = Footprint::Place;
  const auto [left, right] = std::minmax({corner[0].x, corner[1].x, corner[2].x, corner[3].x});
  const auto [top, bottom] = std::minmax({corner[0].y, corner[1].y, corner[2].y, corner[3].y});
  out.box = {left - margin, right + margin, top - margin, bottom + margin};
  out.area = std::abs((corner[2].x - corner[0].x) * (corner[3].y - corner[1].y) -
                      (corner[3].x - corner[1].x) * (corner[2].y - corner[0].y)) /
             2;
  const auto per_pixel = [&](const Point& a, const Point& b, int pixels) {
    return pixels > 1 ? distance(a, b) / (pixels - 1) : 0;
  };
  const int columns = block.x_end - block.x_begin, rows = block.y_end - block.y_begin;
  out.spacing =
      std::max({per_pixel(corner[0], corner[1], columns), per_pixel(corner[3], corner[2], columns),
                per_pixel(corner[0], corner[3], rows), per_pixel(corner[1], corner[2], rows)});
  const Box& box = out.box;
  if (!std::isfinite(box.area())) return;
  const bool outside =
      box.right <= 0 || box.bottom <= 0 || box.left >= s.width || box.top >= s.height;
  out.place = outside ? Place::kUnseen : Place::kAhead;
}

Footprint find_fisheye_footprint(const SourceView& s, const PixelBlock& block) {
  const auto& m = s.ideal_from_pixel;
  std::array<Eigen::Vector3d, 4> directions;
  std::array<Point, 4> corner = corners_of(block);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto row = [&](std::size_t r) {
      return m[3 * r] * corner[i].x + (m[3 * r + 1] * corner[i].y + m[3 * r + 2]);
    };
    directions[i] = {row(0), row(1), row(2)};
    const Eigen::Vector2d pixel = fisheye_position(s, directions[i]);
    corner[i] = {pixel.x(), pixel.y()};
  }
  const FisheyeFootprint found = fisheye_footprint(s, directions, true);
  Footprint out;
  if (found.place == FisheyeFootprint::Place::kUnseen) return out;
  out.place = Footprint::Place::kUnclear;
  const bool one_pixel = block.x_end - block.x_begin == 1 && block.y_end - block.y_begin == 1;
  if (found.place == FisheyeFootprint::Place::kUnclear || (found.is_at_limit && !one_pixel)) {
    return out;
  }
  enclose(s, block, corner, found.margin + kRounding, out);
  return out;
}

Footprint find_footprint(const SourceView& s, const PixelBlock& block) {
  using Place = Footprint::Place;
  if (s.is_fisheye) return find_fisheye_footprint(s, block);
  Footprint out;
  const auto& m = s.ideal_from_pixel;
  std::array<Point, 4> corner = corners_of(block);
  double radius = 0;
  int behind = 0;
  for (Point& p : corner) {
    const double w = m[6] * p.x + (m[7] * p.y + m[8]);
    if (!(w > 0)) ++behind;
    p = {(m[0] * p.x + (m[1] * p.y + m[2])) / w, (m[3] * p.x + (m[4] * p.y + m[5])) / w};
    radius = std::max(radius, std::sqrt(p.x * p.x + p.y * p.y));
  }
  if (behind == 4) return out;
  out.place = Place::kUnclear;
  if (behind > 0 || !std::isfinite(radius)) return out;
  double margin = kRounding;
  if (s.distorted) {
    const double diameter =
        std::max({distance(corner[0], corner[2]), distance(corner[1], corner[3]),
                  distance(corner[0], corner[1]), distance(corner[1], corner[2]),
                  distance(corner[2], corner[3]), distance(corner[3], corner[0])});
    if ((radius - diameter) * (radius - diameter) > s.fold_radius_squared && radius > diameter) {
      out.place = Place::kUnseen;
      return out;
    }
    margin += bend(s, radius) * diameter * diameter / 6 * static_cast<double>(std::max(s.fx, s.fy));
    for (Point& p : corner) p = project_through_lens(s, p);
  }
  for (Point& p : corner) p = {p.x * s.fx + s.cx, p.y * s.fy + s.cy};
  enclose(s, block, corner, margin, out);
  return out;
}

void mark_box(const SourceView& s, const Box& box) {
  // Four neighbours around the position, and the pixels from which their chroma is interpolated.
  const auto first = [&](double edge) {
    return static_cast<int>(std::floor(edge - 0.5)) - s.chroma_radius;
  };
  const auto last = [&](double edge) {
    return static_cast<int>(std::floor(edge + 0.5)) + s.chroma_radius;
  };
  const int left = std::max(first(std::max(box.left, 0.0)), 0) >> s.mcu_width_log2;
  const int top = std::max(first(std::max(box.top, 0.0)), 0) >> s.mcu_height_log2;
  const int right =
      std::min(last(std::min<double>(box.right, s.width)), s.width - 1) >> s.mcu_width_log2;
  const int bottom =
      std::min(last(std::min<double>(box.bottom, s.height)), s.height - 1) >> s.mcu_height_log2;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) mark_mcu(s.wanted_mcus, y * s.mcus_per_row + x);
  }
}

}  // namespace

void mark_block(const SourceView& source, const PixelBlock& block) {
  const int columns = block.x_end - block.x_begin, rows = block.y_end - block.y_begin;
  if (columns <= 0 || rows <= 0) return;
  const bool one_pixel = columns == 1 && rows == 1;
  const Footprint found = find_footprint(source, block);
  if (found.place == Footprint::Place::kUnseen) return;
  if (found.place == Footprint::Place::kAhead) {
    const int mcu_width = 1 << source.mcu_width_log2, mcu_height = 1 << source.mcu_height_log2;
    const bool is_tight = found.box.area() <= 1.5 * found.area + 2 * mcu_width * mcu_height &&
                          found.spacing <= std::max(mcu_width, mcu_height);
    if (is_tight || one_pixel) return mark_box(source, found.box);
  }
  if (one_pixel) return;
  PixelBlock first = block, second = block;
  if (columns >= rows) {
    first.x_end = second.x_begin = block.x_begin + columns / 2;
  } else {
    first.y_end = second.y_begin = block.y_begin + rows / 2;
  }
  mark_block(source, first);
  mark_block(source, second);
}

}  // namespace raystage::render
