// SPDX-License-Identifier: Apache-2.0
// Focal plane reconstruction (thesis 4.1.2): three cameras per ray with barycentric weights,
// sampled on a plane or on planes of objects. Plans which MCUs each block reads, decodes them and
// runs the kernels of sampling/source_view.h. Output: R, G, B, A, coverage, depth. Cost: pixels x 3
// cameras. Must match render_focal_plane_reference().

#include "render/planar/focal_plane.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"
#include "render/planar/coverage_measures.h"
#include "render/planar/view_rows.h"
#include "render/sampling/needed_mcus.h"
#include "render/sampling/source_frames.h"

namespace raystage {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

std::array<double, 3> as_array(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// Renders one view in stages: plan (which source pixels), decode, blend.
class FocalPlaneFrame {
  static constexpr int kRowsPerBlock = 8;

 public:
  FocalPlaneFrame(const VirtualCamera& view, const LightFieldFrame& instant,
                  const Eigen::Vector4d& plane, CornerWeights weights, bool count_needed,
                  const ViewRegion* region)
      : view_(view),
        instant_(instant),
        projection_(view, plane),
        cells_(view, *instant.rig, *instant.present),
        weights_(weights),
        count_needed_(count_needed),
        region_(region),
        rows_(view, cells_, region),
        sources_(instant, projection_, count_needed) {}

  RenderedView render() {
    if (is_eye_on_plane()) return empty_view(view_);
    RenderedView image = uninitialised_view(view_);
    const auto decoded = decode(image.statistics);
    blend(image, SumStage::kSampleAndFinish);
    lower_coverage_of_absent(image);
    image.statistics.render_ms = milliseconds(Clock::now() - decoded);
    return image;
  }

  Contribution contribute() {
    Contribution contribution;
    contribution.planes.emplace_back(view_value_count(view_), 0.0F);
    if (is_eye_on_plane()) return contribution;
    const auto decoded = decode(contribution.statistics);
    rows_.for_each_row_block([&](int first, int end) {
      for (int y = first; y < end; ++y) {
        for (const RayCells::Span& span : rows_.spans(y)) {
          const PixelRun run = run_of(span, y);
          if (!has_frame(run)) continue;
          const std::size_t at =
              static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width) +
              static_cast<std::size_t>(span.begin);
          blend_run(run, instant_.cache->blend_space(), 1, &contribution.planes[0][at * 4], nullptr,
                    nullptr, SumStage::kSampleOnly);
        }
      }
    });
    contribution.statistics.render_ms = milliseconds(Clock::now() - decoded);
    return contribution;
  }

  RenderedView combine(PixelValues sums) {
    if (is_eye_on_plane()) return empty_view(view_);
    const auto start = Clock::now();
    RenderedView image = uninitialised_view(view_, std::move(sums));
    blend(image, SumStage::kFinishOnly);
    lower_coverage_of_absent(image);
    image.statistics.render_ms = milliseconds(Clock::now() - start);
    return image;
  }

 private:
  bool is_eye_on_plane() const { return !projection_.at_infinity() && projection_.distance() == 0; }

  /// Plans and decodes; returns the time when both were done.
  Clock::time_point decode(RenderStatistics& statistics) {
    const auto start = Clock::now();
    open_cameras();
    mark_needed();
    const auto planned = Clock::now();
    sources_.decode(statistics);
    const auto decoded = Clock::now();
    statistics.plan_ms = milliseconds(planned - start);
    statistics.decode_ms = milliseconds(decoded - planned);
    return decoded;
  }

  static bool has_frame(const PixelRun& run) {
    return std::any_of(run.source.begin(), run.source.begin() + run.count,
                       [](const SourceView* source) { return source->rgba != nullptr; });
  }

  /// Returns the local cameras of all cells in view.
  void open_cameras() {
    std::vector<bool> used(instant_.rig->cameras.size());
    for (int y = 0; y < view_.height; ++y) {
      for (const RayCells::Span& span : rows_.spans(y)) {
        const RayCells::Cell& cell = cells_.cells()[static_cast<std::size_t>(span.cell)];
        for (int c = 0; c < cell.count; ++c) {
          used[static_cast<std::size_t>(cell.camera[static_cast<std::size_t>(c)])] = true;
        }
      }
    }
    std::vector<int> cameras;
    for (std::size_t i = 0; i < used.size(); ++i) {
      const int camera = static_cast<int>(i);
      if (used[i] && instant_.is_local(camera)) cameras.push_back(camera);
    }
    sources_.open(cameras);
  }

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
    run.edge_products = cell.edge_products;
    return run;
  }

  void mark_needed() {
    if (sources_.are_fully_decoded()) return;
    raystage::parallel_for(0, (view_.height + kRowsPerBlock - 1) / kRowsPerBlock, [&](int block) {
      const int first = block * kRowsPerBlock;
      const int end = std::min(first + kRowsPerBlock, view_.height);
      // Marks single taps where kernels skip pixels of a cell, or where pixels are counted.
      if (weights_ == CornerWeights::kNearest || count_needed_ || !meets_plane(first, end)) {
        for (int y = first; y < end; ++y) {
          for (const RayCells::Span& span : rows_.spans(y)) mark_run(run_of(span, y));
        }
      } else {
        mark_blocks(first, end);
      }
    });
  }

  /// Whether all rays of rows [first, end) meet the plane. The corners decide: slope is linear.
  bool meets_plane(int first, int end) const {
    if (projection_.at_infinity()) return true;
    const double right = view_.width - 0.5;
    return projection_.depth(0.5, first + 0.5) > 0 && projection_.depth(right, first + 0.5) > 0 &&
           projection_.depth(0.5, end - 0.5) > 0 && projection_.depth(right, end - 0.5) > 0;
  }

  void mark_blocks(int first, int end) {
    rows_.for_each_cell(first, end, [&](int index, int x_begin, int x_end, int y_begin, int y_end) {
      const RayCells::Cell& cell = cells_.cells()[static_cast<std::size_t>(index)];
      for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
        const SourceView& camera = sources_.view(cell.camera[i]);
        if (camera.wanted_mcus == nullptr || cell.share[i].isZero(0)) continue;
        mark_block(camera, {x_begin, x_end, y_begin, y_end});
      }
    });
  }

  void blend(RenderedView& image, SumStage sums) {
    const auto full_scale = static_cast<float>(instant_.cache->full_scale());
    const BlendSpace space = instant_.cache->blend_space();
    rows_.write(image, [&](const RayCells::Span& span, int y, std::size_t at) {
      blend_run(run_of(span, y), space, full_scale, &image.rgba[at * 4], &image.coverage[at],
                &image.z[at], sums);
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
    const ViewRows rows(view_, complete, region_);
    rows.for_each_row_block([&](int first, int end) {
      for (int y = first; y < end; ++y) {
        for (const RayCells::Span& span : rows.spans(y)) {
          if (lacks[static_cast<std::size_t>(span.cell)]) lower_coverage(complete, span, y, image);
        }
      }
    });
  }

  void lower_coverage(const RayCells& complete, const RayCells::Span& span, int y,
                      RenderedView& image) const {
    const RayCells::Cell& cell = complete.cells()[static_cast<std::size_t>(span.cell)];
    for (int x = span.begin; x < span.end; ++x) {
      auto crossing = complete.crossing_in_cell(span.cell, x + 0.5, y + 0.5);
      if (weights_ == CornerWeights::kNearest) crossing = complete.nearest(crossing);
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.width) +
                             static_cast<std::size_t>(x);
      for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
        if (instant_.is_present(cell.camera[i])) continue;
        image.coverage[at] -= image.rgba[at * 4 + 3] * static_cast<float>(crossing.weight[i]);
      }
      image.coverage[at] = std::max(0.0F, image.coverage[at]);  // rounding may give less than 0
    }
  }

  const VirtualCamera& view_;
  const LightFieldFrame& instant_;
  PlaneProjection projection_;
  RayCells cells_;
  CornerWeights weights_;
  bool count_needed_;
  const ViewRegion* region_;  // null: the whole view
  ViewRows rows_;
  SourceFrames sources_;
};

}  // namespace

RenderedView render_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                const Eigen::Vector4d& plane, CornerWeights weights,
                                bool count_needed_pixels, const ViewRegion* region) {
  return FocalPlaneFrame(view, instant, plane, weights, count_needed_pixels, region).render();
}

Contribution contribute_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                    const Eigen::Vector4d& plane, CornerWeights weights,
                                    bool count_needed_pixels, const ViewRegion* region) {
  return FocalPlaneFrame(view, instant, plane, weights, count_needed_pixels, region).contribute();
}

RenderedView combine_focal_plane(const VirtualCamera& view, const LightFieldFrame& instant,
                                 const Eigen::Vector4d& plane, CornerWeights weights,
                                 PixelValues sums, const ViewRegion* region) {
  return FocalPlaneFrame(view, instant, plane, weights, false, region).combine(std::move(sums));
}

namespace {

std::filesystem::path objects_file(const MethodOptions& options, const Take& take) {
  return take.folder() / options.text("objects");
}

std::shared_ptr<const std::vector<ObjectPlane>> objects_of(const ViewRequest& request) {
  if (request.options.text("objects").empty()) {
    return std::make_shared<const std::vector<ObjectPlane>>();
  }
  const std::filesystem::path file = objects_file(request.options, *request.instant.take);
  return request.result_cache.get<std::vector<ObjectPlane>>(
      "object planes " + file.string(), [&file](std::size_t& bytes) {
        auto objects = make_object_planes(read_planes(file), file.string());
        bytes = objects.size() * (sizeof(ObjectPlane) + 8 * sizeof(Eigen::Vector3d));
        return std::make_shared<const std::vector<ObjectPlane>>(std::move(objects));
      });
}

bool is_in_view(const ViewRegion& region) {
  return std::ranges::any_of(region, [](const auto& row) { return !row.empty(); });
}

/// Returns the view with each region on its own plane. Calls render(index, plane, region) for the
/// focal plane (index 0), then for the objects in view.
template <class Render>
RenderedView on_planes(const ViewRequest& r, const std::vector<ObjectPlane>& objects,
                       const Render& render) {
  if (objects.empty()) return render(0, r.focal_plane, nullptr);
  const auto start = Clock::now();
  const std::vector<ViewRegion> regions = object_regions(r.view, objects);
  const double regions_ms = milliseconds(Clock::now() - start);
  RenderedView image = render(0, r.focal_plane, &regions.back());
  image.statistics.plan_ms += regions_ms;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (!is_in_view(regions[i])) continue;
    insert_region(render(i + 1, objects[i].plane, &regions[i]), regions[i], image);
    image.statistics.working_bytes = view_buffer_bytes(r.view);  // one object at a time
  }
  return image;
}

const std::vector<OptionSpec>& plane_options() {
  static const std::vector<OptionSpec> options{text_option(
      "objects", "",
      "planes of objects: a raystage/planes/1 document, relative to the take's folder; rays that "
      "meet an object are sampled on its plane instead of the focal plane")};
  return options;
}

/// The methods that blend three cameras per ray, on the focal plane or on planes of objects.
class PlaneMethod : public Method {
 public:
  explicit PlaneMethod(CornerWeights weights) : weights_(weights) {}

  std::span<const OptionSpec> options() const override { return plane_options(); }

  RenderedView render(const ViewRequest& r) const override {
    RenderedView image =
        on_planes(r, *objects_of(r),
                  [&](std::size_t, const Eigen::Vector4d& plane, const ViewRegion* region) {
                    return render_focal_plane(r.view, r.instant, plane, weights_,
                                              r.count_needed_pixels, region);
                  });
    if (r.measure_coverage) measure_planar_coverage(r, weights_, image);
    return image;
  }

  DistributionMode distribution(const MethodOptions&) const override {
    return DistributionMode::kContributions;
  }

  Contribution contribute(const ViewRequest& r) const override {
    const auto objects = objects_of(r);
    const auto on_plane = [&](const Eigen::Vector4d& plane, const ViewRegion* region) {
      return contribute_focal_plane(r.view, r.instant, plane, weights_, r.count_needed_pixels,
                                    region);
    };
    if (objects->empty()) return on_plane(r.focal_plane, nullptr);
    const std::vector<ViewRegion> regions = object_regions(r.view, *objects);
    Contribution all = on_plane(r.focal_plane, &regions.back());
    for (std::size_t i = 0; i < objects->size(); ++i) {
      Contribution one = on_plane((*objects)[i].plane, &regions[i]);
      all.planes.push_back(std::move(one.planes[0]));
      all.statistics.pixels_decoded += one.statistics.pixels_decoded;
      all.statistics.decode_ms += one.statistics.decode_ms;
      all.statistics.render_ms += one.statistics.render_ms;
    }
    return all;
  }

  RenderedView combine(const ViewRequest& r, std::vector<PixelValues> planes) const override {
    RenderedView image =
        on_planes(r, *objects_of(r),
                  [&](std::size_t index, const Eigen::Vector4d& plane, const ViewRegion* region) {
                    return combine_focal_plane(r.view, r.instant, plane, weights_,
                                               std::move(planes.at(index)), region);
                  });
    if (r.measure_coverage) measure_planar_coverage(r, weights_, image);
    return image;
  }

  RenderedView render_reference(const ViewRequest& r) const override {
    RenderedView image = render_focal_plane_reference(r, weights_, *objects_of(r));
    if (r.measure_coverage) measure_planar_coverage(r, weights_, image);
    return image;
  }

  std::vector<std::filesystem::path> input_files(const MethodOptions& options, const Take& take,
                                                 const FrameSelection&) const override {
    if (options.text("objects").empty()) return {};
    return {objects_file(options, take)};
  }

  /// Regions of objects are computed for the whole view.
  bool is_row_independent(const MethodOptions& options) const override {
    return options.text("objects").empty();
  }
  bool caches_frames_only(const MethodOptions& options) const override {
    return options.text("objects").empty();
  }

 private:
  CornerWeights weights_;
};

class FocalPlaneMethod final : public PlaneMethod {
 public:
  FocalPlaneMethod() : PlaneMethod(CornerWeights::kLinear) {}
  std::string_view name() const override { return "focal_plane"; }
  std::string_view summary() const override {
    return "blends three cameras per ray where it meets the focal plane";
  }
};

class NearestMethod final : public PlaneMethod {
 public:
  NearestMethod() : PlaneMethod(CornerWeights::kNearest) {}
  std::string_view name() const override { return "nearest"; }
  std::string_view summary() const override {
    return "samples only the camera nearest to the ray, where it meets the focal plane";
  }
};

}  // namespace

const Method& focal_plane_method() {
  static const FocalPlaneMethod method;
  return method;
}

const Method& nearest_method() {
  static const NearestMethod method;
  return method;
}

}  // namespace raystage
