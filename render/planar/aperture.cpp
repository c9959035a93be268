// SPDX-License-Identifier: Apache-2.0
// Synthetic aperture (Isaksen, McMillan, Gortler 2000; thesis, Reconstruction): blends all cameras
// around a ray's crossing with the array (weights: ApertureLens). Each camera is sampled where the
// ray meets the focal plane or a depth map. Plans which MCUs each block reads, decodes them and
// runs the kernels of sampling/aperture_run.h. Output: R, G, B, A, coverage, depth. Cost: pixels x
// cameras in the aperture. Must match aperture_reference.cpp.

#include "render/planar/aperture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "render/planar/aperture_lens.h"
#include "render/planar/coverage_measures.h"
#include "render/planar/depth_map.h"
#include "render/planar/planar_frame.h"
#include "render/sampling/aperture_run.h"
#include "render/sampling/depth_planning.h"
#include "render/sampling/depth_sampling.h"
#include "render/sampling/needed_mcus.h"

namespace raystage::render {
namespace {

std::array<float, 2> as_floats(const Eigen::Vector2d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y())};
}

Eigen::Vector4d plane_of(const ViewRequest& request) {
  const double distance = request.options.number("focus_distance");
  return distance > 0 ? view_parallel_plane(request.view, distance) : request.focal_plane;
}

class ApertureFrame final : public PlanarFrame {
 public:
  explicit ApertureFrame(const ViewRequest& request)
      : ApertureFrame{
            request,
            ApertureLens(request.view, request.instant, plane_of(request), request.options),
            make_view_depths(request)} {}

 private:
  ApertureFrame(const ViewRequest& request, ApertureLens lens, std::optional<ViewDepths> depths)
      : PlanarFrame(request.view, request.instant,
                    depths ? Eigen::Vector4d(0, 0, 0, 1) : plane_of(request), nullptr,
                    request.count_needed_pixels),
        request_(request),
        lens_(std::move(lens)),
        depths_(std::move(depths)) {
    for (const Eigen::Vector2d& side : lens_.sides()) sides_.push_back(as_floats(side));
  }

  RenderedView transparent_view() const override {
    RenderedView nothing = empty_view(view_);
    if (request_.measure_coverage) measure_aperture_coverage(request_, lens_, nothing);
    return nothing;
  }

  void blend_span(const RayCells::Span& span, int y, float full_scale, float* rgba, float* coverage,
                  float* z, SumStage sums) override {
    std::vector<float> scratch;
    blend_aperture_run(run_of(span, y, scratch), instant_.cache->blend_space(), full_scale, rgba,
                       coverage, z, sums);
  }

  void complete(RenderedView& image) const override {
    if (request_.measure_coverage) measure_aperture_coverage(request_, lens_, image);
    if (!lens_.note().empty()) image.notes.push_back(lens_.note());
  }

  bool has_frame(const RayCells::Span& span) override {
    return std::ranges::any_of(cameras_[span.cell], [](const ApertureCamera& camera) {
      return camera.source != nullptr && camera.source->rgba != nullptr;
    });
  }

  /// Lists, per cell, the cameras that may contribute to a ray through it.
  void find_cameras() override {
    const std::size_t count = cells_.cells().size();
    std::vector<bool> cell_used(count);
    used_.assign(lens_.cameras().size(), false);
    for (int y = 0; y < view_.height; ++y) {
      for (const RayCells::Span& span : rows_.spans(y)) cell_used[span.cell] = true;
    }
    gathering_.resize(count);
    planes_.resize(count);
    for (std::size_t c = 0; c < count; ++c) {
      if (!cell_used[c]) continue;
      const RayCells::Cell& cell = cells_.cells()[c];
      planes_[c] = lens_.plane_of(cell);
      std::vector<Eigen::Vector2d> corners;
      for (int i = 0; i < cell.count; ++i) corners.push_back(place(c, cell.camera[i]));
      const Disc disc = disc_around(corners);
      for (std::size_t i = 0; i < used_.size(); ++i) {
        if (may_gather(c, static_cast<int>(i), disc)) {
          gathering_[c].push_back(static_cast<int>(i));
          used_[i] = true;
        }
      }
    }
    cameras_.resize(count);
    for (std::size_t c = 0; c < count; ++c) {
      for (const int camera : gathering_[c]) cameras_[c].push_back(as_seen(c, camera));
    }
  }

  Eigen::Vector2d place(std::size_t cell, int camera) const {
    return planes_[cell].place_of(lens_.cameras()[camera]);
  }

  /// Returns DepthSource::per_inverse_depth of the camera.
  std::array<double, 3> way_to_eye(int camera) const {
    return depth_source(view_, instant_.rig->cameras[camera]).per_inverse_depth;
  }

  ApertureCamera as_seen(std::size_t cell, int index) {
    const ApertureLens::Camera& camera = lens_.cameras()[index];
    const Eigen::Vector2d there = place(cell, index);
    const bool present = instant_.is_present(index);
    return {.x = static_cast<float>(there.x()),
            .y = static_cast<float>(there.y()),
            .height_squared = static_cast<float>(planes_[cell].relative_height_squared(camera)),
            .inverse_radius = static_cast<float>(1 / camera.radius),
            .present = present,
            .source = present ? &sources_.view(index) : nullptr,
            .per_inverse_depth = way_to_eye(index)};
  }

  /// A disc in the plane of a cell, metres.
  struct Disc {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    double radius = 0;
  };
  /// Returns a disc that contains all points (at least one).
  static Disc disc_around(std::span<const Eigen::Vector2d> points) {
    Disc disc;
    for (const Eigen::Vector2d& point : points) {
      disc.middle += point / static_cast<double>(points.size());
    }
    double squared = 0;
    for (const Eigen::Vector2d& point : points) {
      squared = std::max(squared, (point - disc.middle).squaredNorm());
    }
    disc.radius = std::sqrt(squared) * (1 + 1e-6);
    return disc;
  }

  /// Returns whether a camera's weight may be above 0 for a ray that crosses the cell within
  /// `disc`.
  bool may_gather(std::size_t cell, int camera, const Disc& disc) const {
    const double radius = lens_.cameras()[camera].radius;
    if (radius == 0) return false;
    if (planes_[cell].relative_height_squared(lens_.cameras()[camera]) >= 1) return false;
    const double to_corner = lens_.sides().empty() ? 1 : 1.4143;  // largest: the square's
    const double within = radius * to_corner + disc.radius;
    return (place(cell, camera) - disc.middle).squaredNorm() <= within * within;
  }

  /// Returns the run of a span. It may point into `scratch`.
  ApertureRun run_of(const RayCells::Span& span, int y, std::vector<float>& scratch) const {
    const RayCells::Cell& cell = cells_.cells()[span.cell];
    ApertureRun run;
    run.cell = run_in_cell(span, y);
    for (int i = 0; i < cell.count; ++i) {
      run.corner[i] = as_floats(place(static_cast<std::size_t>(span.cell), cell.camera[i]));
    }
    run.cameras = cameras_[span.cell];
    run.opaque = !request_.instant.cache->has_matte();
    run.shape = {sides_, static_cast<float>(lens_.steepness())};
    if (depths_) run.inverse_depth = depths_->run(span.begin, span.end, y, scratch);
    return run;
  }

  void mark_rows(int first, int end) override {
    mark_blocks(first, end);
    if (!request_.count_needed_pixels) return;
    std::vector<float> scratch;
    for (int y = first; y < end; ++y) {
      for (const RayCells::Span& span : rows_.spans(y)) {
        mark_aperture_pixels(run_of(span, y, scratch));
      }
    }
  }

  /// Marks what rows [first, end) read of each camera, one block per camera.
  void mark_blocks(int first, int end) {
    constexpr int kColumnsPerBlock = 8;
    std::vector<PixelBlock> blocks(lens_.cameras().size());
    rows_.for_each_cell(first, end, [&](int index, int x_begin, int x_end, int y_begin, int y_end) {
      const auto cell = static_cast<std::size_t>(index);
      for (int x = x_begin; x < x_end; x += kColumnsPerBlock) {
        const PixelBlock part{x, std::min(x + kColumnsPerBlock, x_end), y_begin, y_end};
        const Disc disc = disc_around(crossings(cell, part));
        for (const int camera : gathering_[cell]) {
          if (!instant_.is_present(camera) || !may_gather(cell, camera, disc)) continue;
          if (depths_) {
            mark_at_depths(camera, part);
            continue;
          }
          PixelBlock& block = blocks[camera];
          if (block.x_end == 0) {
            block = part;
          } else {
            block = {std::min(block.x_begin, part.x_begin), std::max(block.x_end, part.x_end),
                     std::min(block.y_begin, part.y_begin), std::max(block.y_end, part.y_end)};
          }
        }
      }
    });
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      if (blocks[i].x_end == 0) continue;
      const SourceView& camera = sources_.view(static_cast<int>(i));
      if (camera.wanted_mcus != nullptr) mark_block(camera, blocks[i]);
    }
  }

  /// Marks what the block reads of a camera at the block's depths.
  void mark_at_depths(int camera, const PixelBlock& part) {
    ViewBlock block{part.x_begin,
                    part.x_end,
                    part.y_begin,
                    part.y_end,
                    std::numeric_limits<double>::infinity(),
                    0};
    for (int y = part.y_begin; y < part.y_end; ++y) {
      for (int x = part.x_begin; x < part.x_end; ++x) {
        const auto inverse = static_cast<double>(depths_->at(x, y));
        if (!(inverse >= 0)) continue;
        block.farthest = std::min(block.farthest, inverse);
        block.nearest = std::max(block.nearest, inverse);
      }
    }
    if (!(block.farthest <= block.nearest)) return;  // no depth in the block
    const SourceView& opened = sources_.view(camera);
    if (opened.wanted_mcus == nullptr) return;
    const DepthSource source{opened, way_to_eye(camera)};
    mark_block(source, block, Interpolation::kLinear);
  }

  /// Returns points whose convex hull contains all crossings of the block's rays with a cell. They
  /// are the crossings of the corners' rays with the cell's plane, or the cell's cameras.
  std::vector<Eigen::Vector2d> crossings(std::size_t index, const PixelBlock& block) const {
    const RayCells::Cell& cell = cells_.cells()[index];
    std::vector<Eigen::Vector2d> points, cameras;
    for (int i = 0; i < cell.count; ++i) cameras.push_back(place(index, cell.camera[i]));
    double first_total = 0;
    for (const double y : {block.y_begin + 0.5, block.y_end - 0.5}) {
      for (const double x : {block.x_begin + 0.5, block.x_end - 0.5}) {
        const Eigen::Vector3d pixel(x, y, 1);
        const double total = cell.total.dot(pixel);
        if (first_total == 0) first_total = total;
        if (!(total * first_total > 0)) return cameras;  // the plane's horizon crosses it
        Eigen::Vector2d point = Eigen::Vector2d::Zero();
        for (std::size_t i = 0; i < cameras.size(); ++i) {
          point += cell.share[i].dot(pixel) / total * cameras[i];
        }
        points.push_back(point);
      }
    }
    return points;
  }

  const ViewRequest& request_;
  ApertureLens lens_;
  std::optional<ViewDepths> depths_;  // nullopt: a plane is used
  std::vector<std::array<float, 2>> sides_;
  std::vector<ApertureLens::Plane> planes_;           // per cell that rays cross
  std::vector<std::vector<int>> gathering_;           // per cell: cameras of the rig
  std::vector<std::vector<ApertureCamera>> cameras_;  // per cell: as gathering_
};

class ApertureMethod final : public Method {
 public:
  std::string_view name() const override { return "aperture"; }
  MethodDescription description() const override {
    return {.summary =
                "blends all cameras within an aperture around the ray, focused on the focal plane "
                "or at a depth map",
            .artefacts = "soft off the plane, as with any lens",
            .use = "focus pulls, looking past objects in front"};
  }
  std::span<const OptionSpec> options() const override { return aperture_options(); }
  RenderedView render(const ViewRequest& request) const override {
    return ApertureFrame(request).render();
  }
  RenderedView render_reference(const ViewRequest& request) const override {
    return render_aperture_reference(request);
  }
  DistributionMode distribution(const MethodOptions&) const override {
    return DistributionMode::kContributions;
  }
  Contribution contribute(const ViewRequest& request) const override {
    return ApertureFrame(request).contribute();
  }
  RenderedView combine(const ViewRequest& request, std::vector<PixelValues> planes) const override {
    return ApertureFrame(request).combine(std::move(planes.at(0)));
  }
  void check(const MethodOptions& options, const store::Take&) const override {
    check_aperture_options(options);
  }
  std::vector<std::filesystem::path> input_files(const MethodOptions& options,
                                                 const store::Take& take,
                                                 const store::FrameSelection&) const override {
    const std::filesystem::path map = depth_map_file(options, take);
    return map.empty() ? std::vector<std::filesystem::path>{} : std::vector{map};
  }
  bool caches_frames_only(const MethodOptions& options) const override {
    return options.text("depth_map").empty();
  }
  bool is_row_independent(const MethodOptions&) const override { return true; }
  bool has_lens() const override { return true; }
};

}  // namespace

const Method& aperture_method() {
  static const ApertureMethod method;
  return method;
}

}  // namespace raystage::render
