// SPDX-License-Identifier: Apache-2.0
#include "render/planar/focal_plane.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <mutex>

#include "render/planar/coverage_measures.h"
#include "render/sampling/source_view.h"
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

int log2_of(int power_of_two) {
  int log2 = 0;
  while ((1 << log2) < power_of_two) ++log2;
  return log2;
}

/// One view's rendering, stage by stage: plan (which source pixels), decode, blend.
class FocalPlaneFrame {
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
        sources_(instant.rig->cameras.size()) {}

  RenderedView render() {
    RenderedView image = empty_view(view_);
    if (!projection_.at_infinity() && projection_.distance() == 0)
      return image;  // eye on the plane
    const auto start = Clock::now();
    find_spans();
    open_sources();
    mark_needed();
    const auto planned = Clock::now();
    decode(image.statistics);
    const auto decoded = Clock::now();
    blend(image);
    lower_coverage_of_absent(image);
    image.statistics.plan_ms = milliseconds(planned - start);
    image.statistics.decode_ms = milliseconds(decoded - planned);
    image.statistics.render_ms = milliseconds(Clock::now() - decoded);
    return image;
  }

 private:
  struct Source {
    SourceView view;  // its rgbx stays null where no pixel of the view sees anything of the camera
    McuMask wanted;   // empty: the whole frame is decoded already
    std::vector<std::uint8_t> read_pixels;
    std::shared_ptr<const DecodedFrame> frame;
    bool used = false;
  };

  template <class Body>
  void for_each_row(const Body& body) const {
    constexpr int kRowsPerTask = 16;
    raystage::parallel_for(tbb::blocked_range<int>(0, view_.height, kRowsPerTask),
                           [&](const tbb::blocked_range<int>& rows) {
                             for (int y = rows.begin(); y < rows.end(); ++y) body(y);
                           });
  }

  void find_spans() {
    constexpr int kRowsPerTask = 16;
    raystage::parallel_for(tbb::blocked_range<int>(0, view_.height, kRowsPerTask),
                           [&](const tbb::blocked_range<int>& rows) {
                             std::vector<int> scratch;
                             for (int y = rows.begin(); y < rows.end(); ++y) {
                               cells_.spans_of_row(y, view_.width, scratch,
                                                   spans_[static_cast<std::size_t>(y)]);
                             }
                           });
    std::vector<bool> cell_used(cells_.cells().size());
    for (const auto& row : spans_) {
      for (const RayCells::Span& span : row) cell_used[static_cast<std::size_t>(span.cell)] = true;
    }
    for (std::size_t i = 0; i < cell_used.size(); ++i) {
      if (!cell_used[i]) continue;
      const RayCells::Cell& cell = cells_.cells()[i];
      for (int c = 0; c < cell.count; ++c)
        source(cell.camera[static_cast<std::size_t>(c)]).used = true;
    }
  }

  Source& source(int camera) { return sources_[static_cast<std::size_t>(camera)]; }

  /// Geometry and frame layout of every camera that some cell in view belongs to.
  void open_sources() {
    raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t i) {
      Source& opened = sources_[i];
      if (!opened.used) return;
      const Rig::Camera& camera = instant_.rig->cameras[i];
      opened.view = source_view_of(camera.model, projection_.ideal_from_pixel(camera.pose));
      SourceView& s = opened.view;
      const auto layout = instant_.cache->layout(static_cast<int>(i), instant_.frame_of_camera[i]);
      opened.wanted.assign(static_cast<std::size_t>(layout->mcu_count()), 0);
      s.wanted_mcus = opened.wanted.data();
      s.mcus_per_row = layout->mcus_per_row;
      s.mcu_width_log2 = log2_of(layout->mcu_width);
      s.mcu_height_log2 = log2_of(layout->mcu_height);
      s.chroma_reach = layout->mcu_width > 8 || layout->mcu_height > 8 ? 1 : 0;
      if (count_needed_) {
        opened.read_pixels.assign(
            static_cast<std::size_t>(s.width) * static_cast<std::size_t>(s.height), 0);
        s.read_pixels = opened.read_pixels.data();
      }
    });
  }

  PixelRun run_of(const RayCells::Span& span, int y) {
    const RayCells::Cell& cell = cells_.cells()[static_cast<std::size_t>(span.cell)];
    PixelRun run;
    run.begin = span.begin;
    run.end = span.end;
    run.y = y;
    run.count = cell.count;
    for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
      run.source[i] = &source(cell.camera[i]).view;
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

  /// Rows go through private copies of the masks, joined afterwards: threads share no byte.
  void mark_needed() {
    if (std::all_of(sources_.begin(), sources_.end(),
                    [](const Source& source) { return source.wanted.empty(); })) {
      return;
    }
    std::mutex joining;
    const int rows_per_task = std::max(16, view_.height / 8);
    raystage::parallel_for(
        tbb::blocked_range<int>(0, view_.height, static_cast<std::size_t>(rows_per_task)),
        [&](const tbb::blocked_range<int>& rows) {
          std::vector<McuMask> masks(sources_.size());
          std::vector<std::vector<std::uint8_t>> pixels(sources_.size());
          std::vector<SourceView> views(sources_.size());
          for (std::size_t i = 0; i < sources_.size(); ++i) {
            if (!sources_[i].used) continue;
            views[i] = sources_[i].view;
            if (sources_[i].wanted.empty()) continue;
            masks[i].assign(sources_[i].wanted.size(), 0);
            views[i].wanted_mcus = masks[i].data();
            if (!count_needed_) continue;
            pixels[i].assign(sources_[i].read_pixels.size(), 0);
            views[i].read_pixels = pixels[i].data();
          }
          for (int y = rows.begin(); y < rows.end(); ++y) {
            for (const RayCells::Span& span : spans_[static_cast<std::size_t>(y)]) {
              PixelRun run = run_of(span, y);
              const auto& cameras = cells_.cells()[static_cast<std::size_t>(span.cell)].camera;
              for (std::size_t i = 0; i < static_cast<std::size_t>(run.count); ++i) {
                run.source[i] = &views[static_cast<std::size_t>(cameras[i])];
              }
              mark_run(run);
            }
          }
          const std::scoped_lock lock(joining);
          for (std::size_t i = 0; i < sources_.size(); ++i) {
            join(masks[i], sources_[i].wanted);
            join(pixels[i], sources_[i].read_pixels);
          }
        });
  }

  static void join(const std::vector<std::uint8_t>& part, std::vector<std::uint8_t>& whole) {
    for (std::size_t i = 0; i < part.size(); ++i) whole[i] |= part[i];
  }

  void decode(RenderStatistics& statistics) {
    std::atomic<std::int64_t> pixels = 0, needed = 0;
    std::atomic<int> cameras = 0;
    raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t i) {
      Source& wanted = sources_[i];
      if (!wanted.used) return;
      const bool is_whole =
          wanted.wanted.empty();  // ... was, at least: fetch sees to it if need be
      if (!is_whole &&
          std::find(wanted.wanted.begin(), wanted.wanted.end(), 1) == wanted.wanted.end()) {
        return;
      }
      std::int64_t decoded = 0;
      wanted.frame = instant_.cache->fetch(static_cast<int>(i), instant_.frame_of_camera[i],
                                           wanted.wanted, decoded);
      wanted.view.rgbx = wanted.frame->rgbx.get();
      pixels += decoded;
      needed += std::count(wanted.read_pixels.begin(), wanted.read_pixels.end(), 1);
      ++cameras;
    });
    statistics.pixels_decoded = pixels;
    statistics.pixels_needed = needed;
    statistics.cameras_used = cameras;
  }

  void blend(RenderedView& image) {
    const auto full_scale = static_cast<float>(instant_.cache->full_scale());
    for_each_row([&](int y) {
      const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width);
      for (const RayCells::Span& span : spans_[static_cast<std::size_t>(y)]) {
        const std::size_t at = row + static_cast<std::size_t>(span.begin);
        blend_run(run_of(span, y), instant_.cache->blend_space(), full_scale, &image.rgba[at * 4],
                  &image.z[at]);
      }
      for (std::size_t at = row; at < row + static_cast<std::size_t>(view_.width); ++at) {
        image.coverage[at] = image.rgba[at * 4 + 3];
      }
    });
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
      image.coverage[at] = std::max(0.0F, image.coverage[at]);  // all absent, and rounded
    }
  }

  const VirtualCamera& view_;
  const Instant& instant_;
  PlaneProjection projection_;
  RayCells cells_;
  CornerWeights weights_;
  bool count_needed_;
  std::vector<std::vector<RayCells::Span>> spans_;  // per row of the view
  std::vector<Source> sources_;                     // per camera of the rig
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
  RenderedView image =
      render_focal_plane(r.view, r.instant, r.focal_plane, kWeights, r.count_needed_pixels);
  if (r.measure_coverage) measure_planar_coverage(r, kWeights, image);
  return image;
}

template <CornerWeights kWeights>
RenderedView on_plane_reference(const ViewRequest& r) {
  RenderedView image = render_focal_plane_reference(r.view, r.instant, r.focal_plane, kWeights,
                                                    r.count_needed_pixels);
  if (r.measure_coverage) measure_planar_coverage(r, kWeights, image);
  return image;
}

}  // namespace

Method focal_plane_method() {
  return {"focal_plane",
          "three cameras a ray, blended where it meets the focal plane",
          {},
          on_plane<CornerWeights::kLinear>,
          on_plane_reference<CornerWeights::kLinear>,
          nullptr,
          true};
}

Method nearest_method() {
  return {"nearest",
          "the camera nearest to the ray, alone, where it meets the focal plane",
          {},
          on_plane<CornerWeights::kNearest>,
          on_plane_reference<CornerWeights::kNearest>,
          nullptr,
          true};
}

}  // namespace raystage
