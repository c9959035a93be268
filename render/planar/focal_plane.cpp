// SPDX-License-Identifier: Apache-2.0
// Focal plane reconstruction (thesis 4.1.2): three cameras per ray with barycentric weights,
// sampled on a plane or on planes of objects. Plans which MCUs each block reads, decodes them and
// runs the kernels of sampling/source_view.h. Output: R, G, B, A, coverage, depth. Cost: pixels x 3
// cameras. Must match focal_plane_reference.cpp.

#include "render/planar/focal_plane.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "render/common/row_note.h"
#include "render/planar/coverage_measures.h"
#include "render/planar/planar_frame.h"
#include "render/sampling/needed_mcus.h"

namespace raystage::render {
namespace {

class FocalPlaneFrame final : public PlanarFrame {
 public:
  /// Prepares a view. `region`: the pixels to render, the others stay unseen; null: all.
  FocalPlaneFrame(const ViewRequest& request, const Eigen::Vector4d& plane, CornerWeights weights,
                  const ViewRegion* region)
      : PlanarFrame(request.view, request.instant, plane, region, request.count_needed_pixels),
        weights_(weights),
        count_needed_(request.count_needed_pixels),
        region_(region) {}

 private:
  bool has_frame(const RayCells::Span& span) override {
    const RayCells::Cell& cell = cells_.cells()[span.cell];
    return std::any_of(cell.camera.begin(), cell.camera.begin() + cell.count,
                       [this](int camera) { return sources_.view(camera).rgba != nullptr; });
  }

  void find_cameras() override {
    for (int y = 0; y < view_.height; ++y) {
      for (const RayCells::Span& span : rows_.spans(y)) {
        const RayCells::Cell& cell = cells_.cells()[span.cell];
        for (int c = 0; c < cell.count; ++c) used_[cell.camera[c]] = true;
      }
    }
  }

  PixelRun run_of(const RayCells::Span& span, int y) {
    const RayCells::Cell& cell = cells_.cells()[span.cell];
    PixelRun run = run_in_cell(span, y);
    for (int i = 0; i < cell.count; ++i) run.source[i] = &sources_.view(cell.camera[i]);
    run.nearest_only = weights_ == CornerWeights::kNearest;
    run.edge_products = cell.edge_products;
    return run;
  }

  /// Marks single taps where kernels skip pixels of a cell, or where pixels are counted.
  void mark_rows(int first, int end) override {
    if (weights_ == CornerWeights::kLinear && !count_needed_ && meets_plane(first, end)) {
      mark_blocks(first, end);
      return;
    }
    for (int y = first; y < end; ++y) {
      for (const RayCells::Span& span : rows_.spans(y)) mark_run(run_of(span, y));
    }
  }

  /// Returns whether all rays of rows [first, end) meet the plane. The corners decide: slope is
  /// linear.
  bool meets_plane(int first, int end) const {
    if (projection_.at_infinity()) return true;
    const double right = view_.width - 0.5;
    return projection_.depth(0.5, first + 0.5) > 0 && projection_.depth(right, first + 0.5) > 0 &&
           projection_.depth(0.5, end - 0.5) > 0 && projection_.depth(right, end - 0.5) > 0;
  }

  void mark_blocks(int first, int end) {
    rows_.for_each_cell(first, end, [&](int index, int x_begin, int x_end, int y_begin, int y_end) {
      const RayCells::Cell& cell = cells_.cells()[index];
      for (int i = 0; i < cell.count; ++i) {
        const SourceView& camera = sources_.view(cell.camera[i]);
        if (camera.wanted_mcus == nullptr || cell.share[i].isZero(0)) continue;
        mark_block(camera, {x_begin, x_end, y_begin, y_end});
      }
    });
  }

  void blend_span(const RayCells::Span& span, int y, float full_scale, float* rgba, float* coverage,
                  float* z, SumStage sums) override {
    blend_run(run_of(span, y), instant_.cache->blend_space(), full_scale, rgba, coverage, z, sums);
  }

  /// Lowers the coverage of rays to which absent cameras would contribute.
  void complete(RenderedView& image) const override {
    add_row_note(*instant_.complete, image);
    if (instant_.present == instant_.complete) return;
    const RayCells all(view_, *instant_.rig, *instant_.complete);
    std::vector<bool> lacks(all.cells().size());
    for (std::size_t i = 0; i < lacks.size(); ++i) {
      const RayCells::Cell& cell = all.cells()[i];
      for (int c = 0; c < cell.count; ++c) {
        if (!instant_.is_present(cell.camera[c])) lacks[i] = true;
      }
    }
    const ViewRows rows(view_, all, region_);
    rows.for_each_row_block([&](int first, int end) {
      for (int y = first; y < end; ++y) {
        for (const RayCells::Span& span : rows.spans(y)) {
          if (lacks[span.cell]) lower_coverage(all, span, y, image);
        }
      }
    });
  }

  void lower_coverage(const RayCells& all, const RayCells::Span& span, int y,
                      RenderedView& image) const {
    const RayCells::Cell& cell = all.cells()[span.cell];
    for (int x = span.begin; x < span.end; ++x) {
      auto crossing = all.crossing_in_cell(span.cell, x + 0.5, y + 0.5);
      if (weights_ == CornerWeights::kNearest) crossing = all.nearest(crossing);
      const std::size_t at = image.index(x, y);
      for (int i = 0; i < cell.count; ++i) {
        if (instant_.is_present(cell.camera[i])) continue;
        image.coverage[at] -= image.rgba[at * 4 + 3] * static_cast<float>(crossing.weight[i]);
      }
      image.coverage[at] = std::max(0.0F, image.coverage[at]);  // rounding may give less than 0
    }
  }

  CornerWeights weights_;
  bool count_needed_;
  const ViewRegion* region_;  // null: the whole view
};

std::filesystem::path objects_file(const MethodOptions& options, const store::Take& take) {
  return take.folder() / options.text("objects");
}

std::shared_ptr<const std::vector<ObjectPlane>> objects_of(const ViewRequest& request) {
  if (request.options.text("objects").empty()) {
    return std::make_shared<const std::vector<ObjectPlane>>();
  }
  const std::filesystem::path file = objects_file(request.options, *request.instant.take);
  return request.result_cache.get<std::vector<ObjectPlane>>(
      "object planes " + file.string(), [&file](std::size_t& bytes) {
        auto objects = make_object_planes(schemas::read_planes(file), file.string());
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
  const auto start = RenderClock::now();
  const std::vector<ViewRegion> regions = object_regions(r.view, objects);
  const double regions_ms = milliseconds(RenderClock::now() - start);
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
    return measured(
        r, on_planes(r, *objects_of(r),
                     [&](std::size_t, const Eigen::Vector4d& plane, const ViewRegion* region) {
                       return FocalPlaneFrame(r, plane, weights_, region).render();
                     }));
  }

  DistributionMode distribution(const MethodOptions&) const override {
    return DistributionMode::kContributions;
  }

  Contribution contribute(const ViewRequest& r) const override {
    const auto objects = objects_of(r);
    const auto on_plane = [&](const Eigen::Vector4d& plane, const ViewRegion* region) {
      return FocalPlaneFrame(r, plane, weights_, region).contribute();
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
    return measured(r, on_planes(r, *objects_of(r),
                                 [&](std::size_t index, const Eigen::Vector4d& plane,
                                     const ViewRegion* region) {
                                   return FocalPlaneFrame(r, plane, weights_, region)
                                       .combine(std::move(planes.at(index)));
                                 }));
  }

  RenderedView render_reference(const ViewRequest& r) const override {
    return measured(r, render_focal_plane_reference(r, weights_, *objects_of(r)));
  }

  std::vector<std::filesystem::path> input_files(const MethodOptions& options,
                                                 const store::Take& take,
                                                 const store::FrameSelection&) const override {
    if (options.text("objects").empty()) return {};
    return {objects_file(options, take)};
  }

  /// Returns false with objects, whose regions are computed for the whole view.
  bool is_row_independent(const MethodOptions& options) const override {
    return options.text("objects").empty();
  }
  bool caches_frames_only(const MethodOptions& options) const override {
    return options.text("objects").empty();
  }

 private:
  RenderedView measured(const ViewRequest& r, RenderedView image) const {
    if (r.measure_coverage) measure_planar_coverage(r, weights_, image);
    return image;
  }

  CornerWeights weights_;
};

class FocalPlaneMethod final : public PlaneMethod {
 public:
  FocalPlaneMethod() : PlaneMethod(CornerWeights::kLinear) {}
  std::string_view name() const override { return "focal_plane"; }
  MethodDescription description() const override {
    return {.summary = "blends three cameras per ray where it meets the focal plane",
            .artefacts = "doubled edges off the plane",
            .use = "a first look, live; flat subjects; dense arrays"};
  }
};

class NearestMethod final : public PlaneMethod {
 public:
  NearestMethod() : PlaneMethod(CornerWeights::kNearest) {}
  std::string_view name() const override { return "nearest"; }
  MethodDescription description() const override {
    return {.summary = "samples only the camera nearest to the ray, where it meets the focal plane",
            .artefacts = "jumps from camera to camera",
            .use = "sharp stills"};
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

}  // namespace raystage::render
