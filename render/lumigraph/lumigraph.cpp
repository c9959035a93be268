// SPDX-License-Identifier: Apache-2.0
// Renders a view by the unstructured lumigraph (Buehler et al., SIGGRAPH 2001; thesis eq. 2.3). Per
// block of 64 x 16 pixels the rays are intersected with the surface and the candidate cameras
// selected (camera_selection.cpp). Then frames are decoded and the rays blended in chunks of 64
// (ray_chunk_kernels.cpp). Input: a surface (inverse distances, 1/m). Output: premultiplied RGBA,
// coverage, z in metres. Cost: O(pixels x candidate cameras). Reference: lumigraph_reference.cpp.
#include "render/lumigraph/lumigraph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "base/parallel.h"
#include "render/common/ray_cells.h"
#include "render/lumigraph/camera_frames.h"
#include "render/lumigraph/camera_selection.h"
#include "render/lumigraph/ray_chunk.h"
#include "render/lumigraph/ray_directions.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

constexpr int kBlockWidth = RayChunk::kSize, kBlockHeight = kBlendingTileSize;
constexpr float kNowhere = std::numeric_limits<float>::infinity();
constexpr int kFieldColumns = kBlockWidth / kBlendingTileSize + 1;

/// A part of the view, and the cameras that can contribute to it.
struct Block {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  ///< pixels; x1 and y1 are exclusive
  std::vector<int> present, complete;  ///< `complete` is set only if it differs
};

struct Scratch {
  std::vector<WorldRay> rays;
  std::vector<double> inverse_distance;
  RayDirections row;
  RayChunk chunk, corners;
  std::vector<const ChunkCamera*> cameras, in_field;
  std::vector<ChunkWeights> weights, corner_weights;
};

/// Renders one view in bands of rows. Stages: surface and cameras, plan, decode, blend.
class LumigraphFrame {
 public:
  LumigraphFrame(const ViewRequest& request, const RaySurface& surface,
                 const RayWeightOptions& weighing, WeightField field, MissedRay missed)
      : request_(request),
        view_(request.view),
        rig_(*request.instant.rig),
        surface_(surface),
        weighing_(weighing),
        spacing_(mean_nearest_baseline(rig_)),
        chunk_weighing_(weighing, spacing_),
        field_(field),
        missed_(missed),
        middle_(rig_.centre()),
        world_ray_(world_ray_from_pixel(request.view)),
        cameras_(chunk_cameras(rig_)),
        frames_(request.instant, request.count_needed_pixels),
        present_(request.instant.present_cameras()),
        complete_(request.instant.included_cameras) {}

  RenderedView render() {
    sums_ = SumStage::kSampleAndFinish;
    return render(uninitialised_view(view_));
  }

  Contribution contribute() {
    sums_ = SumStage::kSampleOnly;
    RenderedView image =
        render(uninitialised_view(view_, PixelValues(view_value_count(view_), 0.0F)));
    Contribution contribution;
    contribution.planes.push_back(std::move(image.rgba));
    contribution.statistics = image.statistics;
    return contribution;
  }

  RenderedView combine(PixelValues sums) {
    sums_ = SumStage::kFinishOnly;
    return render(uninitialised_view(view_, std::move(sums)));
  }

 private:
  RenderedView render(RenderedView image) {
    if (request_.measure_coverage) clear_coverage_measures(image);
    if (missed_ == MissedRay::kKnownEmpty) image.empty_space.assign(image.coverage.size(), 0.0F);
    const int rows = rows_of_band();
    for (top_ = 0; top_ < view_.height; top_ += rows) {
      render_band(std::min(top_ + rows, view_.height), image);
    }
    return image;
  }

  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y) * view_.width + x; }

  std::size_t in_band(int x, int y) const { return at(x, y - top_); }

  /// Returns the rows of whole blocks whose data fit in working memory, at least one block high.
  int rows_of_band() const {
    const auto columns = static_cast<std::size_t>((view_.width + kBlockWidth - 1) / kBlockWidth);
    constexpr std::size_t kListsOfCameras = 2, kGrowth = 2;
    const std::size_t of_block =
        sizeof(Block) + kListsOfCameras * kGrowth * rig_.cameras.size() * sizeof(int);
    const std::size_t of_row = columns * of_block + at(0, kBlockHeight) * sizeof(double);
    const std::size_t blocks_high = std::min<std::size_t>(
        request_.working_bytes / of_row, static_cast<std::size_t>(view_.height / kBlockHeight + 1));
    return std::max(1, static_cast<int>(blocks_high)) * kBlockHeight;
  }

  /// Renders rows from top_ on. Pixels do not depend on other blocks.
  void render_band(int end, RenderedView& image) {
    const auto start = RenderClock::now();
    make_blocks(end);
    intersect_surface(end, image);
    frames_.open(used_cameras());
    if (sums_ != SumStage::kFinishOnly && !frames_.are_fully_decoded()) mark_wanted();
    const auto planned = RenderClock::now();
    frames_.decode(image.statistics);
    for (ChunkCamera& camera : cameras_) camera.lens.rgba = frames_.pixels(camera.camera);
    const auto decoded = RenderClock::now();
    for_each_block([&](const Block& block, Scratch& scratch) {
      if (sums_ == SumStage::kSampleOnly && !reads_any(block)) return;  // the sums are 0
      if (block.present.empty()) leave_empty(block, image);
      for_each_row(block, scratch, [&](int y) { blend_row(block, y, scratch, image); });
    });
    image.statistics.working_bytes = std::max(image.statistics.working_bytes, bytes_worked_in());
    image.statistics.plan_ms += milliseconds(planned - start);
    image.statistics.decode_ms += milliseconds(decoded - planned);
    image.statistics.render_ms += milliseconds(RenderClock::now() - decoded);
  }

  std::size_t bytes_worked_in() const {
    std::size_t bytes = inverse_distance_.size() * sizeof(double) + blocks_.size() * sizeof(Block);
    for (const Block& block : blocks_) {
      bytes += (block.present.capacity() + block.complete.capacity()) * sizeof(int);
    }
    return bytes;
  }

  Vector3d direction(double x, double y) const {
    return (world_ray_ * Vector3d(x, y, 1)).normalized();
  }

  void make_blocks(int end) {
    blocks_.clear();
    for (int y = top_; y < end; y += kBlockHeight) {
      for (int x = 0; x < view_.width; x += kBlockWidth) {
        blocks_.push_back({x,
                           y,
                           std::min(x + kBlockWidth, view_.width),
                           std::min(y + kBlockHeight, end),
                           {},
                           {}});
      }
    }
  }

  template <class Body>
  void for_each_block(const Body& body) {
    raystage::parallel_for(tbb::blocked_range<int>(0, static_cast<int>(blocks_.size())),
                           [&](const tbb::blocked_range<int>& range) {
                             Scratch scratch;
                             for (int i = range.begin(); i < range.end(); ++i) {
                               body(blocks_[i], scratch);
                             }
                           });
  }

  /// Intersects the rays with the surface and selects the cameras that can see the points.
  void intersect_surface(int end, RenderedView& image) {
    find_surface(end, image);
    for_each_block([&](Block& block, Scratch&) {
      double least = std::numeric_limits<double>::infinity(), most = 0;
      for (int y = block.y0; y < block.y1; ++y) {
        for (int x = block.x0; x < block.x1; ++x) {
          const double inverse = inverse_distance_[in_band(x, y)];
          if (!(inverse >= 0)) continue;
          least = std::min(least, inverse);
          most = std::max(most, inverse);
        }
      }
      if (least > most) return;  // no ray hits
      RayBundle bundle;
      bundle.eye = view_.pose.position;
      bundle.corners = {direction(block.x0, block.y0), direction(block.x1, block.y0),
                        direction(block.x0, block.y1), direction(block.x1, block.y1)};
      bundle.min_inverse_distance = least;
      bundle.max_inverse_distance = most;
      block.present = select_candidate_cameras(rig_, present_, bundle, weighing_, spacing_);
      if (present_ == complete_) return;
      block.complete = select_candidate_cameras(rig_, complete_, bundle, weighing_, spacing_);
    });
  }

  /// Intersects the rays; threads share rows of blocks, because some rays take a hundred times as
  /// long as others.
  void find_surface(int end, RenderedView& image) {
    inverse_distance_.resize(in_band(0, end));
    const int rows = static_cast<int>(blocks_.size()) * kBlockHeight;
    raystage::parallel_for(
        tbb::blocked_range<int>(0, rows), [&](const tbb::blocked_range<int>& range) {
          std::vector<WorldRay> rays;
          std::vector<double> inverse_distance;
          RayDirections row;
          for (int i = range.begin(); i < range.end(); ++i) {
            const Block& block = blocks_[i / kBlockHeight];
            const int y = block.y0 + i % kBlockHeight;
            if (y >= block.y1) continue;
            compute_ray_directions(world_ray_, block.x0, y, block.x1 - block.x0, row);
            rays.clear();
            for (int k = 0; k < row.count; ++k) rays.push_back({view_.pose.position, row[k]});
            inverse_distance.resize(rays.size());
            surface_(rays, inverse_distance);
            for (int x = block.x0; x < block.x1; ++x) {
              const double inverse = inverse_distance[x - block.x0];
              inverse_distance_[in_band(x, y)] = inverse;
              if (!(inverse >= 0) && missed_ == MissedRay::kKnownEmpty)
                image.empty_space[at(x, y)] = 1;
            }
          }
        });
  }

  bool is_read(int camera) const {
    return sums_ != SumStage::kFinishOnly && request_.instant.is_local(camera);
  }

  bool reads_any(const Block& block) const {
    return std::ranges::any_of(block.present, [this](int camera) { return is_read(camera); });
  }

  std::vector<bool> used_cameras() const {
    std::vector<bool> used(rig_.cameras.size());
    for (const Block& block : blocks_) {
      for (const int camera : block.present)
        if (is_read(camera)) used[camera] = true;
    }
    return used;
  }

  void set_cameras(const std::vector<int>& cameras, Scratch& scratch) const {
    scratch.cameras.clear();
    for (const int camera : cameras) scratch.cameras.push_back(&cameras_[camera]);
    scratch.weights.resize(cameras.size());
  }

  void set_chunk(const Block& block, int y, Scratch& scratch) const {
    const int count = block.x1 - block.x0;
    compute_ray_directions(world_ray_, block.x0, y, count, scratch.row);
    fill_chunk(view_.pose.position, scratch.row,
               std::span(&inverse_distance_[in_band(block.x0, y)], static_cast<std::size_t>(count)),
               middle_, scratch.chunk);
  }

  /// Calls body(y) for the block's rows with scratch.chunk, cameras and weights set.
  template <class Body>
  void for_each_row(const Block& block, Scratch& scratch, const Body& body) const {
    if (block.present.empty()) return;
    if (field_ == WeightField::kBlendingField) weigh_corners(block, scratch);
    for (int y = block.y0; y < block.y1; ++y) {
      set_chunk(block, y, scratch);
      if (field_ == WeightField::kPerPixel) {
        set_cameras(block.present, scratch);
        compute_camera_weights(scratch.chunk, scratch.cameras, chunk_weighing_, scratch.weights);
      } else {
        scratch.cameras = scratch.in_field;
        scratch.weights.resize(scratch.in_field.size());
        interpolate(y - block.y0, scratch);
        apply_given_weights(scratch.chunk, scratch.cameras, scratch.weights);
      }
      body(y);
    }
  }

  /// Computes the weights at the corners of the block's tiles, of cameras that have any.
  void weigh_corners(const Block& block, Scratch& scratch) const {
    scratch.rays.clear();
    for (const int y : {block.y0, block.y0 + kBlendingTileSize}) {
      for (int column = 0; column < kFieldColumns; ++column) {
        scratch.rays.push_back(
            {view_.pose.position, direction(block.x0 + column * kBlendingTileSize, y)});
      }
    }
    scratch.inverse_distance.resize(scratch.rays.size());
    surface_(scratch.rays, scratch.inverse_distance);
    fill_chunk(scratch.rays, scratch.inverse_distance, middle_, scratch.corners);
    set_cameras(block.present, scratch);
    compute_camera_weights(scratch.corners, scratch.cameras, chunk_weighing_, scratch.weights);
    scratch.in_field.clear();
    scratch.corner_weights.clear();
    for (std::size_t c = 0; c < scratch.cameras.size(); ++c) {
      const auto& weight = scratch.weights[c].weight;
      if (std::all_of(weight.begin(), weight.begin() + scratch.corners.count,
                      [](float w) { return w == 0; })) {
        continue;
      }
      scratch.in_field.push_back(scratch.cameras[c]);
      scratch.corner_weights.push_back(scratch.weights[c]);
    }
  }

  static void interpolate(int row, Scratch& scratch) {
    const float down = (static_cast<float>(row) + 0.5F) / kBlendingTileSize;
    for (std::size_t c = 0; c < scratch.in_field.size(); ++c) {
      const float* upper = scratch.corner_weights[c].weight.data();
      const float* lower = upper + kFieldColumns;
      float* to = scratch.weights[c].weight.data();
      for (int tile = 0; tile + 1 < kFieldColumns; ++tile) {
        const float left = upper[tile] + down * (lower[tile] - upper[tile]);
        const float right = upper[tile + 1] + down * (lower[tile + 1] - upper[tile + 1]);
        for (int i = 0; i < kBlendingTileSize; ++i) {
          *to++ = left + (static_cast<float>(i) + 0.5F) / kBlendingTileSize * (right - left);
        }
      }
    }
  }

  void mark_wanted() {
    for (ChunkCamera& camera : cameras_) frames_.set_mcu_layout(camera.camera, camera.lens);
    for_each_block([&](const Block& block, Scratch& scratch) {
      if (!reads_any(block)) return;
      for_each_row(block, scratch, [&](int) {
        for (std::size_t c = 0; c < scratch.cameras.size(); ++c) {
          if (!is_read(scratch.cameras[c]->camera)) continue;
          mark_needed_mcus(scratch.cameras[c]->lens, scratch.weights[c], scratch.chunk.count);
        }
      });
    });
  }

  void leave_empty(const Block& block, RenderedView& image) const {
    for (int y = block.y0; y < block.y1; ++y) {
      const std::size_t first = at(block.x0, y);
      const int count = block.x1 - block.x0;
      std::fill_n(&image.rgba[first * 4], 4 * count, 0.0F);
      std::fill_n(&image.coverage[first], count, 0.0F);
      std::fill_n(&image.z[first], count, kNowhere);
    }
  }

  void blend_row(const Block& block, int y, Scratch& scratch, RenderedView& image) const {
    const RayChunk& chunk = scratch.chunk;
    const std::size_t first = at(block.x0, y);
    blend_chunk(
        scratch.cameras, scratch.weights, chunk.count, request_.instant.cache->blend_space(),
        static_cast<float>(request_.instant.cache->full_scale()), &image.rgba[first * 4], sums_);
    if (sums_ == SumStage::kSampleOnly) return;
    const Vector3d forward = view_.pose.viewing_direction();
    for (int i = 0; i < chunk.count; ++i) {
      const float alpha = image.rgba[(first + i) * 4 + 3];
      image.coverage[first + i] = alpha;
      const auto ahead = static_cast<float>(forward.dot(scratch.row[i]));
      image.z[first + i] = alpha > 0 ? ahead / chunk.inverse_distance[i] : kNowhere;
    }
    if (request_.measure_coverage) measure(first, scratch, image);
    if (!block.complete.empty()) lower_coverage(block, first, scratch, image);
  }

  static void measure(std::size_t first, const Scratch& scratch, RenderedView& image) {
    alignas(64) std::array<float, RayChunk::kSize> effective{}, nearest{};
    measure_effective_cameras(scratch.chunk, scratch.cameras, scratch.weights, effective.data(),
                              nearest.data());
    std::copy_n(effective.begin(), scratch.chunk.count, &image.cameras[first]);
    std::copy_n(nearest.begin(), scratch.chunk.count, &image.nearest_ray[first]);
  }

  void lower_coverage(const Block& block, std::size_t first, Scratch& scratch,
                      RenderedView& image) const {
    set_cameras(block.complete, scratch);
    compute_camera_weights(scratch.chunk, scratch.cameras, chunk_weighing_, scratch.weights);
    for (std::size_t i = 0; i < static_cast<std::size_t>(scratch.chunk.count); ++i) {
      float total = 0, absent = 0;
      for (std::size_t c = 0; c < scratch.cameras.size(); ++c) {
        const float weight = scratch.weights[c].weight[i];
        total += weight;
        if (!request_.instant.is_present(scratch.cameras[c]->camera)) absent += weight;
      }
      if (total > 0) image.coverage[first + i] *= 1 - absent / total;
    }
  }

  const ViewRequest& request_;
  const VirtualCamera& view_;
  const rig::Rig& rig_;
  const RaySurface& surface_;
  RayWeightOptions weighing_;
  double spacing_;
  ChunkWeightOptions chunk_weighing_;
  WeightField field_;
  MissedRay missed_;
  Vector3d middle_;
  Eigen::Matrix3d world_ray_;
  std::vector<ChunkCamera> cameras_;
  CameraFrames frames_;
  std::vector<int> present_, complete_;
  int top_ = 0;  // first row of the band; the following are of the band
  SumStage sums_ = SumStage::kSampleAndFinish;
  std::vector<Block> blocks_;
  std::vector<double> inverse_distance_;
};

}  // namespace

Contribution contribute_lumigraph(const ViewRequest& request, const RaySurface& surface,
                                  const RayWeightOptions& weighing, WeightField field) {
  return LumigraphFrame(request, surface, weighing, field, MissedRay::kUnseen).contribute();
}

RenderedView combine_lumigraph(const ViewRequest& request, const RaySurface& surface,
                               const RayWeightOptions& weighing, WeightField field,
                               PixelValues sums) {
  return LumigraphFrame(request, surface, weighing, field, MissedRay::kUnseen)
      .combine(std::move(sums));
}

RenderedView render_lumigraph(const ViewRequest& request, const RaySurface& surface,
                              const RayWeightOptions& weighing, WeightField field,
                              MissedRay missed) {
  return LumigraphFrame(request, surface, weighing, field, missed).render();
}

}  // namespace raystage::render
