// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "base/parallel.h"
#include "render/common/ray_cells.h"
#include "render/common/view.h"
#include "render/planar/object_planes.h"

namespace raystage::render {

/// The rows of a view, divided into spans whose rays pass between the same cameras.
class ViewRows {
 public:
  /// Divides the rows of `view`. `region`: the pixels to include; null: all.
  ViewRows(const VirtualCamera& view, const RayCells& cells, const ViewRegion* region = nullptr)
      : width_(view.width), spans_(static_cast<std::size_t>(view.height)) {
    for_each_row_block([&](int first, int end) {
      std::vector<int> scratch;
      for (int y = first; y < end; ++y) {
        std::vector<RayCells::Span>& spans = spans_[y];
        cells.row_spans(y, width_, scratch, spans);
        if (region != nullptr) spans = within((*region)[y], spans);
      }
    });
  }

  const std::vector<RayCells::Span>& spans(int y) const { return spans_[y]; }

  /// Calls body(first row, end) in parallel, for a few rows at a time.
  template <class Body>
  void for_each_row_block(const Body& body) const {
    constexpr int kRowsPerTask = 16;
    raystage::parallel_for(
        tbb::blocked_range<int>(0, static_cast<int>(spans_.size()), kRowsPerTask),
        [&](const tbb::blocked_range<int>& rows) { body(rows.begin(), rows.end()); });
  }

  /// Calls body(span, y, index of its first pixel) for every span, in parallel. Spans of a row are
  /// processed from left to right, so that a body may write beyond the right end. All other pixels
  /// become unseen.
  template <class Body>
  void write(RenderedView& image, const Body& body) const {
    for_each_row_block([&](int first, int end) {
      for (int y = first; y < end; ++y) {
        const std::size_t row = image.index(0, y);
        std::size_t at = row;  // the first pixel not written yet
        for (const RayCells::Span& span : spans(y)) {
          const std::size_t begin = row + span.begin;
          clear_pixels(image, at, begin);
          body(span, y, begin);
          at = row + span.end;
        }
        clear_pixels(image, at, row + width_);
      }
    });
  }

  /// Calls body(cell, x begin, x end, y begin, y end) with the bounding box of the pixels of each
  /// cell that rows [first, end) cross.
  template <class Body>
  void for_each_cell(int first, int end, const Body& body) const {
    struct Box {
      int cell, x_begin, x_end, y_begin, y_end;
    };
    std::vector<Box> boxes;
    for (int y = first; y < end; ++y) {
      for (const RayCells::Span& span : spans(y)) {
        const auto known = std::ranges::find(boxes, span.cell, &Box::cell);
        if (known == boxes.end()) {
          boxes.push_back({span.cell, span.begin, span.end, y, y + 1});
        } else {
          known->x_begin = std::min(known->x_begin, span.begin);
          known->x_end = std::max(known->x_end, span.end);
          known->y_end = y + 1;
        }
      }
    }
    for (const Box& b : boxes) body(b.cell, b.x_begin, b.x_end, b.y_begin, b.y_end);
  }

 private:
  static std::vector<RayCells::Span> within(const std::vector<PixelInterval>& intervals,
                                            const std::vector<RayCells::Span>& spans) {
    std::vector<RayCells::Span> parts;
    for (const PixelInterval& interval : intervals) {
      for (const RayCells::Span& span : spans) {
        const int begin = std::max(span.begin, interval.begin);
        const int end = std::min(span.end, interval.end);
        if (begin < end) parts.push_back({begin, end, span.cell});
      }
    }
    return parts;
  }

  static void clear_pixels(RenderedView& image, std::size_t begin, std::size_t end) {
    std::fill(image.rgba.data() + 4 * begin, image.rgba.data() + 4 * end, 0.0F);
    std::fill(image.coverage.data() + begin, image.coverage.data() + end, 0.0F);
    std::fill(image.z.data() + begin, image.z.data() + end, std::numeric_limits<float>::infinity());
  }

  int width_;
  std::vector<std::vector<RayCells::Span>> spans_;  // per row
};

}  // namespace raystage::render
