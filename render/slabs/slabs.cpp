// SPDX-License-Identifier: Apache-2.0
// Two-plane light field rendering (thesis 2.3 and appendix A; Levoy and Hanrahan 1996). Plans which
// nodes each row of the view needs, and makes or caches their rectified images in bands of rows
// that fit in memory. Interpolates each ray quadrilinearly by slab_kernels.h. Output: R, G, B, A,
// coverage, depth. Cost: pixels x 16 samples, plus rectification once per node. Must match
// slabs_reference.cpp up to rectification.

#include "render/slabs/slabs.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "render/common/plane_projection.h"
#include "render/common/row_note.h"
#include "render/slabs/needed_pixels.h"
#include "render/slabs/node_image.h"
#include "render/slabs/slab_coverage.h"
#include "render/slabs/slab_rays.h"
#include "render/slabs/slab_runs.h"

namespace raystage::render {
namespace {

/// Renders the part of a view that one slab shows: plans which nodes each row needs, then processes
/// bands of rows whose nodes fit in memory.
class SlabFrame {
 public:
  SlabFrame(const ViewRequest& request, const PlaneProjection& projection, const Slab& slab,
            const std::vector<NodeSources>& nodes, NeededPixels& needed, SumStage sums,
            const PixelValues& given)
      : request_(request),
        projection_(projection),
        slab_(slab),
        nodes_(nodes),
        needed_(needed),
        sums_(sums),
        given_(given),
        interpolation_(slab_interpolation(request.options)),
        rays_(request.view, slab),
        functions_(slab, rays_, projection),
        runs_(static_cast<std::size_t>(request.view.height)),
        held_(nodes.size()),
        camera_used_(request.instant.rig->cameras.size()) {}

  void render(RenderedView& image) {
    const auto start = RenderClock::now();
    raystage::parallel_for_grains(0, request_.view.height, kRowsPerTask, [&](int y) {
      rays_.runs_of_row(y, request_.view.width, runs_[y]);
    });
    image.statistics.plan_ms += milliseconds(RenderClock::now() - start);
    for (int begin = 0; begin < request_.view.height;) {
      std::vector<bool> needed(nodes_.size());
      const int end = end_of_band(begin, needed);
      const auto planned = RenderClock::now();
      fetch(needed, image.statistics);
      const auto held = static_cast<std::size_t>(
          std::ranges::count_if(held_, [](const auto& node) { return node != nullptr; }));
      image.statistics.working_bytes =
          std::max(image.statistics.working_bytes, held * node_image_bytes(slab_));
      const auto fetched = RenderClock::now();
      raystage::parallel_for_grains(begin, end, kRowsPerTask, [&](int y) { sample_row(y, image); });
      image.statistics.decode_ms += milliseconds(fetched - planned);
      image.statistics.render_ms += milliseconds(RenderClock::now() - fetched);
      begin = end;
    }
    if (request_.count_needed_pixels) mark_needed();
    image.statistics.cameras_used += static_cast<int>(std::ranges::count(camera_used_, true));
  }

 private:
  static constexpr int kRowsPerTask = 16;

  /// Returns the nodes of a run's cell: upper left, upper right, lower left, lower right; -1 for
  /// those that do not exist.
  std::array<int, 4> nodes_of(const SlabRays::Run& run) const {
    const int first = run.row * slab_.columns + run.column;
    const bool wide = slab_.columns > 1, high = slab_.rows > 1;
    return {first, wide ? first + 1 : -1, high ? first + slab_.columns : -1,
            wide && high ? first + slab_.columns + 1 : -1};
  }

  /// Returns the end of the band from row `begin` on whose nodes, set in `needed`, fit in memory.
  int end_of_band(int begin, std::vector<bool>& needed) const {
    const std::size_t most = request_.working_bytes / node_image_bytes(slab_);
    std::size_t count = 0;
    for (int y = begin; y < request_.view.height; ++y) {
      std::vector<std::size_t> added;
      for (const SlabRays::Run& run : runs_[y]) {
        for (const int node : nodes_of(run)) {
          const auto i = static_cast<std::size_t>(std::max(node, 0));
          if (node < 0 || needed[i] || !is_made_here(nodes_[i])) continue;
          needed[i] = true;
          added.push_back(i);
        }
      }
      count += added.size();
      if (count <= most) continue;
      if (y == begin) throw too_large(count);
      for (const std::size_t node : added) needed[node] = false;
      return y;
    }
    return request_.view.height;
  }

  /// Returns whether this rank makes the node's image.
  bool is_made_here(const NodeSources& node) const {
    if (node.count == 0 || sums_ == SumStage::kFinishOnly) return false;
    const auto heaviest = std::max_element(node.weight.begin(), node.weight.begin() + node.count) -
                          node.weight.begin();
    return request_.instant.is_local(node.camera[heaviest]);
  }

  Error too_large(std::size_t count) const {
    return Error::bad_input(
        fmt::format(
            "a row of the view needs {} node images of {}x{} samples, {:.0f} MB; the memory "
            "budget is {:.0f} MB",
            count, slab_.width, slab_.height,
            static_cast<double>(count * node_image_bytes(slab_)) / 1e6,
            static_cast<double>(request_.working_bytes) / 1e6),
        "method slabs", "Lower the option uv_scale or columns, or increase the memory budget");
  }

  /// Gets the images of the nodes from the previous band or the result cache, or makes them.
  void fetch(const std::vector<bool>& needed, RenderStatistics& statistics) {
    std::vector<int> missing;
    for (std::size_t i = 0; i < needed.size(); ++i) {
      if (!needed[i]) held_[i].reset();
      if (needed[i] && !held_[i]) missing.push_back(static_cast<int>(i));
    }
    std::vector<std::shared_ptr<const NodeImageCache>> slots(missing.size());
    bool are_fully_decoded = true;
    for (std::size_t i = 0; i < missing.size(); ++i) {
      slots[i] = transposed_index(missing[i]);
      const auto image = slots[i]->image();
      are_fully_decoded = are_fully_decoded && image && image->made.is_whole();
    }
    if (!are_fully_decoded) find_runs_of_nodes();
    std::vector<std::int64_t> decoded(missing.size());
    raystage::parallel_for(std::size_t{0}, missing.size(), [&](std::size_t i) {
      held_[missing[i]] = image_of(missing[i], *slots[i], decoded[i]);
    });
    for (std::size_t i = 0; i < missing.size(); ++i) {
      statistics.pixels_decoded += decoded[i];
      const NodeSources& sources = nodes_[missing[i]];
      for (int c = 0; c < sources.count; ++c) camera_used_[sources.camera[c]] = true;
    }
  }

  std::shared_ptr<const NodeImageCache> transposed_index(int node) const {
    return request_.result_cache.get<NodeImageCache>(
        node_image_key(request_.instant, slab_, node % slab_.columns, node / slab_.columns,
                       nodes_[node], request_.focal_plane),
        [&](std::size_t& bytes) {
          bytes = node_image_bytes(slab_);
          return std::make_shared<NodeImageCache>();
        });
  }

  /// Returns a node's image with all samples that the view reads, in any of its bands.
  std::shared_ptr<const NodeImage> image_of(int node, const NodeImageCache& slot,
                                            std::int64_t& pixels_decoded) const {
    auto image = slot.image();
    if (image && image->made.is_whole()) return image;
    NodeRows read(slab_.width, slab_.height);
    for (const RunOfNode& part : runs_of_nodes_[node]) {
      SlabRun run = functions_.run(*part.run, part.y);
      run.interpolation = interpolation_;
      read.add(run, part.corner);
    }
    if (image && image->made.covers(read)) return image;
    if (image) read = NodeRows::all(slab_.width, slab_.height);
    image = make_node_image(request_.instant, slab_, node % slab_.columns, node / slab_.columns,
                            nodes_[node], request_.focal_plane, read);
    pixels_decoded = image->pixels_decoded;
    slot.keep(image);
    return image;
  }

  /// Lists the runs that read each node's image, once for the view.
  void find_runs_of_nodes() {
    if (!runs_of_nodes_.empty()) return;
    runs_of_nodes_.resize(nodes_.size());
    for (int y = 0; y < request_.view.height; ++y) {
      for (const SlabRays::Run& run : runs_[y]) {
        const std::array<int, 4> nodes = nodes_of(run);
        for (int corner = 0; corner < 4; ++corner) {
          const int node = nodes[corner];
          if (node >= 0) runs_of_nodes_[node].push_back({&run, y, corner});
        }
      }
    }
  }

  void mark_needed() {
    const bool nearest = interpolation_ == SlabInterpolation::kNearest;
    for (int y = 0; y < request_.view.height; ++y) {
      for (const SlabRays::Run& run : runs_[y]) {
        std::array<const NodeSources*, 4> around{};
        const std::array<int, 4> nodes = nodes_of(run);
        for (std::size_t i = 0; i < nodes.size(); ++i) {
          if (nodes[i] >= 0) around[i] = &nodes_[nodes[i]];
        }
        needed_.mark(rays_, run, y, nearest, around, projection_);
      }
    }
  }

  void sample_row(int y, RenderedView& image) const {
    const auto full_scale = static_cast<float>(request_.instant.cache->full_scale());
    for (const SlabRays::Run& part : runs_[y]) {
      SlabRun run = functions_.run(part, y);
      run.interpolation = interpolation_;
      const std::array<int, 4> nodes = nodes_of(part);
      for (std::size_t i = 0; i < 4; ++i) {
        if (nodes[i] < 0) continue;
        const auto& held = held_[nodes[i]];
        run.node[i] = held ? held->rgba.get() : nullptr;
      }
      const bool has_node =
          std::ranges::any_of(run.node, [](const auto* n) { return n != nullptr; });
      const std::size_t at = image.index(part.begin, y);
      const auto values = 4 * static_cast<std::size_t>(part.end - part.begin);
      if (sums_ == SumStage::kFinishOnly) std::copy_n(&given_[at * 4], values, &image.rgba[at * 4]);
      if (sums_ == SumStage::kSampleOnly && !has_node) {
        // A ray on the border of two slabs may have sums of the other slab.
        std::fill_n(&image.rgba[at * 4], values, 0.0F);
        continue;
      }
      sample_slab_run(run, request_.instant.cache->blend_space(), full_scale, &image.rgba[at * 4],
                      &image.z[at], sums_);
      if (sums_ == SumStage::kSampleOnly) continue;
      set_coverage(part, nodes, y, image);
    }
  }

  /// Sets coverage: alpha without the weight of absent cameras that others replace.
  void set_coverage(const SlabRays::Run& run, const std::array<int, 4>& nodes, int y,
                    RenderedView& image) const {
    std::array<double, 4> lacking{};
    for (std::size_t i = 0; i < 4; ++i) {
      if (nodes[i] >= 0) lacking[i] = 1 - nodes_[nodes[i]].present_weight;
    }
    const bool any = std::ranges::any_of(lacking, [](double part) { return part > 0; });
    for (int x = run.begin; x < run.end; ++x) {
      const std::size_t at = image.index(x, y);
      image.coverage[at] = image.rgba[at * 4 + 3];
      if (!any) continue;
      const SlabRays::Crossing crossing = rays_.crossing(x + 0.5, y + 0.5);
      double right = std::clamp(crossing.column - run.column, 0.0, 1.0);
      double lower = std::clamp(crossing.row - run.row, 0.0, 1.0);
      if (interpolation_ == SlabInterpolation::kNearest) {
        right = std::floor(right + 0.5);
        lower = std::floor(lower + 0.5);
      }
      const double lacks = (1 - lower) * ((1 - right) * lacking[0] + right * lacking[1]) +
                           lower * ((1 - right) * lacking[2] + right * lacking[3]);
      image.coverage[at] *= static_cast<float>(1 - lacks);
    }
  }

  struct RunOfNode {
    const SlabRays::Run* run;
    int y, corner;
  };

  const ViewRequest& request_;
  const PlaneProjection& projection_;
  const Slab& slab_;
  const std::vector<NodeSources>& nodes_;
  NeededPixels& needed_;
  SumStage sums_;
  const PixelValues& given_;  // sums in place of samples, kFinishOnly
  SlabInterpolation interpolation_;
  SlabRays rays_;
  SlabRuns functions_;
  std::vector<std::vector<SlabRays::Run>> runs_;        // per row of the view
  std::vector<std::vector<RunOfNode>> runs_of_nodes_;   // by node
  std::vector<std::shared_ptr<const NodeImage>> held_;  // by node, of the band
  std::vector<bool> camera_used_;
};

/// Renders the rays of all slabs. `given`: sums of all ranks, with kFinishOnly.
void render_rays(const ViewRequest& request, SumStage sums, const PixelValues& given,
                 RenderedView& image) {
  const auto start = RenderClock::now();
  const auto slabs = rig_slabs(request);
  image.statistics.plan_ms = milliseconds(RenderClock::now() - start);
  NeededPixels needed(request.instant);
  // A ray on the border of two slabs belongs to the first, which is rendered last.
  for (std::size_t i = slabs->slabs.size(); i-- > 0;) {
    const Slab& slab = slabs->slabs[i];
    if (slab.width == 0) continue;  // no camera sees the image plane
    ViewRequest on_face = request;
    on_face.focal_plane = slab_focal_plane(slab, request);
    const PlaneProjection projection(request.view, on_face.focal_plane);
    if (!projection.at_infinity() && projection.distance() == 0) continue;  // eye on the plane
    SlabFrame(on_face, projection, slab, slabs->nodes[i], needed, sums, given).render(image);
  }
  image.statistics.pixels_needed = needed.count();
  if (request.measure_coverage && sums != SumStage::kSampleOnly) {
    measure_slab_coverage(request, *slabs, image);
  }
}

const OptionSpec kOptions[] = {
    choice_option("interpolation", "quadrilinear", "quadrilinear|bilinear_st|nearest",
                  "samples per ray: 4 nodes x 4 pixels, 4 x 1, or 1 x 1"),
    choice_option(
        "layout", "single", "single|box",
        "one slab of all cameras, or up to six around a rig that looks outwards: each ray "
        "uses the face of the box through which it leaves"),
    integer_option("columns", 0, 0, 1024,
                   "nodes (s) along each camera plane; 0: as many as the rig's grid has, or by the "
                   "density of its cameras"),
    integer_option("rows", 0, 0, 1024, "nodes (t) across each camera plane; 0: as for columns"),
    number_option("uv_scale", 1, 0.05, 4,
                  "samples of the image plane (u,v) per finest source pixel, along each axis; the "
                  "memory of a slab grows with its square"),
    number_option("max_fov", 150, 10, 170, "largest full angle of an image plane, degrees"),
};

class SlabsMethod final : public Method {
 public:
  std::string_view name() const override { return "slabs"; }
  MethodDescription description() const override {
    return {
        .summary =
            "blends four cameras per ray, from two-plane light fields (slabs) of rectified frames",
        .artefacts = "soft and doubled off the plane",
        .use = "arrays that look in all directions (layout box)"};
  }
  std::span<const OptionSpec> options() const override { return kOptions; }
  std::span<const MethodPreset> presets() const override {
    static constexpr MethodPreset kPresets[]{{"fast", "interpolation=bilinear_st"},
                                             {"small", "uv_scale=0.5"}};
    return kPresets;
  }
  RenderedView render(const ViewRequest& request) const override {
    RenderedView image = empty_view(request.view);
    render_rays(request, SumStage::kSampleAndFinish, {}, image);
    add_row_note(*request.instant.complete, image);
    if (request.instant.rig->looks_around() && request.options.text("layout") == "single") {
      add_notes({"the array looks around, but layout single shows only what is ahead of it: set "
                 "layout to box"},
                image.notes);
    }
    return image;
  }
  RenderedView render_reference(const ViewRequest& request) const override {
    return render_slabs_reference(request);
  }
  DistributionMode distribution(const MethodOptions&) const override {
    return DistributionMode::kContributions;
  }
  /// Returns the sums of this rank's nodes. A node belongs to the rank of the camera with the
  /// largest weight in it; the frames of its other cameras are read, too.
  Contribution contribute(const ViewRequest& request) const override {
    RenderedView image = empty_view(request.view);
    render_rays(request, SumStage::kSampleOnly, {}, image);
    Contribution contribution;
    contribution.planes.push_back(std::move(image.rgba));
    contribution.statistics = image.statistics;
    return contribution;
  }
  RenderedView combine(const ViewRequest& request, std::vector<PixelValues> planes) const override {
    RenderedView image = empty_view(request.view);
    render_rays(request, SumStage::kFinishOnly, planes.at(0), image);
    return image;
  }
  void check_ray_support(const MethodOptions& options) const override {
    if (options.text("layout") != "box") return;
    throw Error::bad_input(
        "slabs with layout box sample rays on a plane per face, but single rays need one plane",
        "method slabs", "Render views, or choose another method for rays");
  }
  /// Returns true, also where memory is too short to cache node images: bands then make shared
  /// images again, and pixels do not depend on the budget.
  bool is_row_independent(const MethodOptions&) const override { return true; }
};

}  // namespace

const Method& slabs_method() {
  static const SlabsMethod method;
  return method;
}

}  // namespace raystage::render
