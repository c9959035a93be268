// SPDX-License-Identifier: Apache-2.0
// Box matching: finds the plane with the least cost, summed over a square around each pixel by
// running sums along columns and rows. Input: costs (u8) per pixel and plane. Output: plane and
// cost per pixel. Cost: pixels x planes, independent of the radius. Must match
// box_match_reference() to the bit.

#include <algorithm>
#include <stdexcept>

#include "base/parallel.h"
#include "matching/matching.h"
#include "matching/path_kernels.h"

namespace raystage::matching {
namespace {

constexpr int kStripRows = 32;

/// Processes rows [first, last] of an image from top to bottom. Holds the sums of each column's
/// costs over the rows of the square, and along a row the sums of these over its columns.
class BoxStrip {
 public:
  BoxStrip(const CostVolume& volume, const FillCosts& fill, int radius, bool subplane_refinement)
      : volume_(volume),
        fill_(fill),
        radius_(radius),
        sub_plane_(subplane_refinement),
        stride_(static_cast<std::size_t>(plane_stride(volume.planes))),
        row_(stride_ * volume.width),
        rows_(row_ * static_cast<std::size_t>(2 * radius + 1)),
        none_(row_),
        column_sums_(row_),
        window_(stride_),
        nothing_(stride_) {}

  void match(int first, int end, PlaneMap& map) {
    const int top = std::max(0, first - radius_);
    for (int y = top; y < std::min(volume_.height, first + radius_); ++y) add_row(y, none_.data());
    for (int y = first; y < end; ++y) {
      const int comes = y + radius_, goes = y - radius_ - 1;
      if (comes < volume_.height) {
        add_row(comes, goes >= top ? nullptr : none_.data());
      } else if (goes >= top) {
        update_running_sums(column_sums_.data(), none_.data(), cost_row(goes), row_);
      }
      match_row(y, &map.plane[static_cast<std::size_t>(y) * map.width],
                &map.cost[static_cast<std::size_t>(y) * map.width]);
    }
  }

 private:
  std::uint8_t* cost_row(int y) {
    return rows_.data() + static_cast<std::size_t>(y % (2 * radius_ + 1)) * row_;
  }

  /// Adds row y to the sums and subtracts the row that it replaces, or `instead` (zeros).
  void add_row(int y, const std::uint8_t* instead) {
    std::uint8_t* place = cost_row(y);
    if (instead == nullptr) update_running_sums(column_sums_.data(), none_.data(), place, row_);
    fill_(y, {place, row_});
    update_running_sums(column_sums_.data(), place, none_.data(), row_);
  }

  void match_row(int y, float* plane, std::uint8_t* cost) {
    std::fill(window_.begin(), window_.end(), std::uint16_t{0});
    const auto column = [&](int x) {
      return column_sums_.data() + static_cast<std::size_t>(x) * stride_;
    };
    for (int x = 0; x < std::min(radius_, volume_.width); ++x) {
      update_running_window(window_.data(), column(x), nothing_.data(), stride_);
    }
    for (int x = 0; x < volume_.width; ++x) {
      const int comes = x + radius_, goes = x - radius_ - 1;
      update_running_window(window_.data(), comes < volume_.width ? column(comes) : nothing_.data(),
                            goes >= 0 ? column(goes) : nothing_.data(), stride_);
      const int best = index_of_min(window_.data(), volume_.planes);
      const auto at = static_cast<std::size_t>(best);
      const bool between = sub_plane_ && best > 0 && best + 1 < volume_.planes;
      plane[x] = static_cast<float>(best) +
                 (between ? parabola_vertex(window_[at - 1], window_[at], window_[at + 1]) : 0);
      cost[x] = cost_row(y)[static_cast<std::size_t>(x) * stride_ + at];
    }
  }

  const CostVolume& volume_;
  const FillCosts& fill_;
  int radius_;
  bool sub_plane_;
  std::size_t stride_, row_;
  std::vector<std::uint8_t> rows_, none_;
  std::vector<std::uint16_t> column_sums_, window_, nothing_;
};

int strips_of(const CostVolume& volume) { return (volume.height + kStripRows - 1) / kStripRows; }

}  // namespace

std::size_t box_bytes(const CostVolume& volume, int radius, int threads) {
  const auto stride = static_cast<std::size_t>(plane_stride(volume.planes));
  const std::size_t row = stride * volume.width;
  const std::size_t strip = row * (2 * radius + 2) + (row + 2 * stride) * sizeof(std::uint16_t);
  return strip * static_cast<std::size_t>(std::min(threads, strips_of(volume)));
}

PlaneMap box_match(const CostVolume& volume, const FillCosts& fill, int radius,
                   bool subplane_refinement) {
  if (volume.width < 1 || volume.height < 1 || volume.planes < 1 || radius < 0 || radius > 7) {
    throw std::logic_error("box matching: no pixels, no planes, or radius not in 0 to 7");
  }
  PlaneMap map(volume.width, volume.height);
  raystage::parallel_for(0, strips_of(volume), [&](int strip) {
    BoxStrip(volume, fill, radius, subplane_refinement)
        .match(strip * kStripRows, std::min(volume.height, (strip + 1) * kStripRows), map);
  });
  return map;
}

}  // namespace raystage::matching
