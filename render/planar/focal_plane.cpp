// SPDX-License-Identifier: Apache-2.0
#include "render/planar/focal_plane.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>
#include <vector>

#include "render/sampling/needed_mcus.h"
#include "render/sampling/source_frames.h"
#include "render/view/plane_projection.h"
#include "render/view/ray_cells.h"
#include "schemas/parallel.h"

namespace raystage {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

std::array<double, 3> as_array(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// One view's rendering, stage by stage: plan (which source pixels), decode, blend.
class FocalPlaneFrame {
  static constexpr int kRowsPerBlock = 8;

 public:
  FocalPlaneFrame(const VirtualCamera& view, const Instant& instant, const Eigen::Vector4d& plane,
                  CornerWeights weights, bool count_needed)
      : view_(view),
        instant_(instant),
        projection_(view, plane),
        cells_(view, *instant.rig, *instant.present),
        weights_(weights),
        count_needed_(count_needed),
        spans_(static_cast<std::size_t>(view.height)),
        sources_(instant, projection_, count_needed) {}

  RenderedView render() {
    const auto start = Clock::now();
    if (!projection_.at_infinity() && projection_.distance() == 0)
      return empty_view(view_);  // eye on the plane
    RenderedView image = unset_view(view_);
    find_cameras();
    mark_needed();
    const auto planned = Clock::now();
    sources_.decode(image.statistics);
    const auto decoded = Clock::now();
    blend(image);
    lower_coverage_of_absent(image);
    image.statistics.plan_ms = milliseconds(planned - start);
    image.statistics.decode_ms = milliseconds(decoded - planned);
    image.statistics.render_ms = milliseconds(Clock::now() - decoded);
    return image;
  }

 private:
  template <class Body>
  void for_each_row(const Body& body) const {
    constexpr int kRowsPerTask = 16;
    raystage::parallel_for(tbb::blocked_range<int>(0, view_.height, kRowsPerTask),
                           [&](const tbb::blocked_range<int>& rows) {
                             for (int y = rows.begin(); y < rows.end(); ++y) body(y);
                           });
  }

  /// Spans of every row, and the cameras of their cells.
  void find_cameras() {
    constexpr int kRowsPerTask = 16;
    raystage::parallel_for(tbb::blocked_range<int>(0, view_.height, kRowsPerTask),
                           [&](const tbb::blocked_range<int>& rows) {
                             std::vector<int> scratch;
                             for (int y = rows.begin(); y < rows.end(); ++y) {
                               cells_.spans_of_row(y, view_.width, scratch,
                                                   spans_[static_cast<std::size_t>(y)]);
                             }
                           });
    std::vector<bool> used(instant_.rig->cameras.size());
    for (const auto& row : spans_) {
      for (const RayCells::Span& span : row) {
        const RayCells::Cell& cell = cells_.cells()[static_cast<std::size_t>(span.cell)];
        for (int c = 0; c < cell.count; ++c) {
          used[static_cast<std::size_t>(cell.camera[static_cast<std::size_t>(c)])] = true;
        }
      }
    }
    std::vector<int> cameras;
    for (std::size_t i = 0; i < used.size(); ++i) {
      if (used[i]) cameras.push_back(static_cast<int>(i));
    }
    sources_.open(cameras);
  }

  std::vector<RayCells::Span>& spans_of(int y) { return spans_[static_cast<std::size_t>(y)]; }

  PixelRun run_of(const RayCells::Span& span, int y) {
    const RayCells::Cell& cell = cells_.cells()[static_cast<std::size_t>(span.cell)];
    PixelRun run;
    run.begin = span.begin;
    run.end = span.end;
    run.y = y;
    run.room_end = view_.width;  // rows are written from left to right
    run.count = cell.count;
    for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
      run.source[i] = &sources_.view(cell.camera[i]);
      run.share[i] = as_array(cell.share[i]);
    }
    run.total = as_array(cell.total);
    run.slope = as_array(projection_.slope());
    run.distance = projection_.distance();
    run.at_infinity = projection_.at_infinity();
    run.nearest_only = weights_ == CornerWeights::kNearest;
    run.corner_products = cell.corner_products;
    return run;
  }

  void mark_needed() {
    if (sources_.all_whole()) return;
    raystage::parallel_for(0, (view_.height + kRowsPerBlock - 1) / kRowsPerBlock, [&](int block) {
      const int first = block * kRowsPerBlock;
      const int end = std::min(first + kRowsPerBlock, view_.height);
      // Tap by tap where the kernels leave out some of a cell's pixels, or somebody counts.
      if (weights_ == CornerWeights::kNearest || count_needed_ || !meets_plane(first, end)) {
        for (int y = first; y < end; ++y) {
          for (const RayCells::Span& span : spans_of(y)) mark_run(run_of(span, y));
        }
      } else {
        mark_blocks(first, end);
      }
    });
  }

  /// Whether all rays of rows [first, end) do: the slope is linear, so that the corners tell.
  bool meets_plane(int first, int end) const {
    if (projection_.at_infinity()) return true;
    const double right = view_.width - 0.5;
    return projection_.depth(0.5, first + 0.5) > 0 && projection_.depth(right, first + 0.5) > 0 &&
           projection_.depth(0.5, end - 0.5) > 0 && projection_.depth(right, end - 0.5) > 0;
  }

  /// Rows [first, end), cell by cell.
  void mark_blocks(int first, int end) {
    std::vector<std::pair<int, PixelBlock>> blocks;
    for (int y = first; y < end; ++y) {
      for (const RayCells::Span& span : spans_of(y)) {
        const auto known = std::ranges::find(blocks, span.cell, &std::pair<int, PixelBlock>::first);
        if (known == blocks.end()) {
          blocks.push_back({span.cell, {span.begin, span.end, y, y + 1}});
        } else {
          PixelBlock& block = known->second;
          block.x_begin = std::min(block.x_begin, span.begin);
          block.x_end = std::max(block.x_end, span.end);
          block.y_end = y + 1;
        }
      }
    }
    for (const auto& [index, block] : blocks) {
      const RayCells::Cell& cell = cells_.cells()[static_cast<std::size_t>(index)];
      for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
        const SourceView& camera = sources_.view(cell.camera[i]);
        if (camera.wanted_mcus != nullptr) mark_block(camera, block);
      }
    }
  }

  void blend(RenderedView& image) {
    const auto full_scale = static_cast<float>(instant_.cache->full_scale());
    for_each_row([&](int y) {
      const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width);
      std::size_t at = row;  // the first pixel not written yet
      for (const RayCells::Span& span : spans_of(y)) {
        const std::size_t begin = row + static_cast<std::size_t>(span.begin);
        leave_unseen(image, at, begin);
        blend_run(run_of(span, y), instant_.cache->blend_space(), full_scale,
                  &image.rgba[begin * 4], &image.coverage[begin], &image.z[begin]);
        at = row + static_cast<std::size_t>(span.end);
      }
      leave_unseen(image, at, row + static_cast<std::size_t>(view_.width));
    });
  }

  static void leave_unseen(RenderedView& image, std::size_t begin, std::size_t end) {
    std::fill(image.rgba.data() + 4 * begin, image.rgba.data() + 4 * end, 0.0F);
    std::fill(image.coverage.data() + begin, image.coverage.data() + end, 0.0F);
    std::fill(image.z.data() + begin, image.z.data() + end, std::numeric_limits<float>::infinity());
  }

  void lower_coverage_of_absent(RenderedView& image) const {
    if (instant_.present == instant_.complete) return;
    const RayCells complete(view_, *instant_.rig, *instant_.complete);
    std::vector<bool> lacks(complete.cells().size());
    for (std::size_t i = 0; i < lacks.size(); ++i) {
      const RayCells::Cell& cell = complete.cells()[i];
      for (std::size_t c = 0; c < static_cast<std::size_t>(cell.count); ++c) {
        if (!instant_.is_present(cell.camera[c])) lacks[i] = true;
      }
    }
    for_each_row([&](int y) {
      std::vector<int> scratch;
      std::vector<RayCells::Span> spans;
      complete.spans_of_row(y, view_.width, scratch, spans);
      for (const RayCells::Span& span : spans) {
        if (lacks[static_cast<std::size_t>(span.cell)]) lower_coverage(complete, span, y, image);
      }
    });
  }

  void lower_coverage(const RayCells& complete, const RayCells::Span& span, int y,
                      RenderedView& image) const {
    const RayCells::Cell& cell = complete.cells()[static_cast<std::size_t>(span.cell)];
    for (int x = span.begin; x < span.end; ++x) {
      auto crossing = complete.crossing_of(span.cell, x + 0.5, y + 0.5);
      if (weights_ == CornerWeights::kNearest) crossing = complete.nearest(crossing);
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width) +
                             static_cast<std::size_t>(x);
      for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
        if (instant_.is_present(cell.camera[i])) continue;
        image.coverage[at] -= image.rgba[at * 4 + 3] * static_cast<float>(crossing.weight[i]);
      }
    }
  }

  const VirtualCamera& view_;
  const Instant& instant_;
  PlaneProjection projection_;
  RayCells cells_;
  CornerWeights weights_;
  bool count_needed_;
  std::vector<std::vector<RayCells::Span>> spans_;  // per row of the view
  SourceFrames sources_;
};

}  // namespace

RenderedView render_focal_plane(const VirtualCamera& view, const Instant& instant,
                                const Eigen::Vector4d& plane, CornerWeights weights,
                                bool count_needed_pixels) {
  return FocalPlaneFrame(view, instant, plane, weights, count_needed_pixels).render();
}

namespace {

template <CornerWeights kWeights>
RenderedView on_plane(const ViewRequest& r) {
  return render_focal_plane(r.view, r.instant, r.focal_plane, kWeights, r.count_needed_pixels);
}

template <CornerWeights kWeights>
RenderedView on_plane_reference(const ViewRequest& r) {
  return render_focal_plane_reference(r.view, r.instant, r.focal_plane, kWeights,
                                      r.count_needed_pixels);
}

}  // namespace

Method focal_plane_method() {
  return {"focal_plane",
          "three cameras a ray, blended where it meets the focal plane",
          {},
          on_plane<CornerWeights::kLinear>,
          on_plane_reference<CornerWeights::kLinear>};
}

Method nearest_method() {
  return {"nearest",
          "the camera nearest to the ray, alone, where it meets the focal plane",
          {},
          on_plane<CornerWeights::kNearest>,
          on_plane_reference<CornerWeights::kNearest>};
}

}  // namespace raystage
