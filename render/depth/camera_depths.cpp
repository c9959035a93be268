// SPDX-License-Identifier: Apache-2.0
// Estimates an inverse depth map (1/m) for each camera of a light field frame in three passes over
// all cameras:
//   1. matching with up to 8 neighbours on planes of even inverse depth (match_row(): mean of the
//      smaller half of the truncated luma differences), and semi-global matching (Hirschmueller
//      2008, matching);
//   2. fusion of the hypotheses of the neighbours and the camera itself (fusion.cpp), and less
//      foreground fattening (foreground_fattening.cpp);
//   3. refinement by fractions of a pixel against all cameras that see the point (refine_row():
//      Geman-McClure residuals), smoothed by domain_transform_filter() along edges of picture and
//      depth.
// Cost per camera: O(pixels x planes x neighbours) for pass 1, O(pixels x support views x offsets)
// for pass 3. Memory is planned by estimation_memory.h; the result does not depend on it.
// Reference: camera_depths_reference.cpp.
#include "render/depth/camera_depths.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/large_buffer.h"
#include "base/options.h"
#include "base/parallel.h"
#include "matching/matching.h"
#include "render/depth/estimation_kernels.h"
#include "render/depth/estimation_memory.h"
#include "render/depth/foreground_fattening.h"
#include "render/depth/fusion.h"
#include "render/depth/matching_image.h"
#include "render/depth/warp.h"

namespace raystage::render {
namespace {

std::size_t pixels_of(const VirtualCamera& camera) {
  return static_cast<std::size_t>(camera.width) * camera.height;
}

class Solver {
 public:
  /// Prepares the estimation. `group`: null if this host estimates the depths of all cameras.
  Solver(const LightFieldFrame& instant, const DepthEstimationOptions& options,
         std::size_t working_bytes, const RankCommunicator* group)
      : instant_(instant),
        options_(options),
        group_(group),
        depths_(camera_depths_without_maps(instant, options)),
        images_(depths_.pinholes.size()) {
    for (const rig::Rig::Camera& camera : instant.rig->cameras) {
      whole_.push_back(undistorted(camera.model, camera.pose));
    }
    std::vector<std::size_t> pixels;
    for (std::size_t i = 0; i < images_.size(); ++i) {
      if (!instant.is_present(static_cast<int>(i))) continue;
      members_.push_back(static_cast<int>(i));
      pixels.push_back(pixels_of(whole_[i]));
    }
    initial_pass_ = {positions_read(options.neighbours, Partners::kAll), true, false};
    // Maps of those with depths, and pictures of all.
    fusion_pass_ = {positions_read(options.neighbours, Partners::kEstimated), true, true};
    for (std::size_t i = 0; i < members_.size(); ++i) {
      std::vector<std::size_t>& reads = fusion_pass_.reads[i];
      for (const std::size_t other : initial_pass_.reads[i]) {
        if (std::ranges::find(reads, other) == reads.end()) reads.push_back(other);
      }
    }
    refinement_pass_ = {positions_read(options.support_views, Partners::kEstimated), true, true};
    is_read_here_.assign(members_.size(), false);
    for (const EstimationPass* pass : {&initial_pass_, &fusion_pass_, &refinement_pass_}) {
      for (std::size_t i = 0; i < members_.size(); ++i) {
        if (!is_solved(i)) continue;
        is_read_here_[i] = true;
        for (const std::size_t other : pass->reads[i]) is_read_here_[other] = true;
      }
    }
    for (std::size_t i = 0; i < members_.size(); ++i)
      if (!is_read_here_[i]) pixels[i] = 0;
    memory_ = plan_estimation_memory({initial_pass_, fusion_pass_, refinement_pass_}, pixels,
                                     camera_bytes(), working_bytes);
    const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
    depths_.working_bytes =
        memory_.held + std::min(memory_.in_flight, threads) * std::min(memory_.each, most_used());
  }

  CameraDepths solve() {
    constexpr int kPasses = 3;
    count_parts(&StoredDataCounts::parts_begun, kPasses * std::ssize(members_));
    {
      BufferPool buffers;
      for_each_camera(initial_pass_, [&](int camera) { return initial_depths(camera, buffers); });
    }
    if (depths_.inverse_depth_per_pixel > 0) {
      exchange_maps(fusion_pass_);
      for_each_camera(fusion_pass_, [&](int camera) { return fused_depths(camera); });
      exchange_maps(refinement_pass_);
      for_each_camera(refinement_pass_, [&](int camera) { return refined_depths(camera); });
    }
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (!is_solved(i)) depths_.maps[members_[i]] = {};
    }
    depths_.pixels_decoded = pixels_decoded_;
    return std::move(depths_);
  }

 private:
  const VirtualCamera& pinhole(int camera) const { return depths_.pinholes[camera]; }
  const InverseDepthMap& map(int camera) const { return depths_.maps[camera]; }
  const MatchingImage& image(int camera) const { return images_[camera]; }
  /// Returns the pixels of a camera whose depths are estimated.
  MatchingImage own_image(int camera) const {
    return options_.regions.empty() ? image(camera)
                                    : image(camera).cropped(options_.regions[camera]);
  }
  InverseDepthRange range(int camera) const {
    return inverse_depth_range_in_view(pinhole(camera), *instant_.rig, options_.scene);
  }
  bool is_estimated(int camera) const { return has_region(options_.regions, camera); }

  /// Whether other cameras are read for their pictures, or for their depths, too.
  enum class Partners { kAll, kEstimated };

  std::vector<int> neighbours(int camera, int count, Partners partners) const {
    if (partners == Partners::kAll) {
      return depth_neighbours(depths_, instant_, camera, range(camera), count);
    }
    std::vector<int> nearest = depth_neighbours(depths_, instant_, camera, range(camera),
                                                static_cast<int>(members_.size()));
    std::erase_if(nearest, [&](int other) { return !is_estimated(other); });
    nearest.resize(std::min(nearest.size(), static_cast<std::size_t>(count)));
    return nearest;
  }

  /// Returns whether this host estimates the depths of a member.
  bool is_solved(std::size_t member) const {
    const int camera = members_[member];
    return is_estimated(camera) && (group_ == nullptr || instant_.is_local(camera));
  }

  int host_of(std::size_t member) const { return instant_.rank_of_camera[members_[member]]; }

  /// Sends the maps that other hosts read in a pass, and receives those that this host reads.
  void exchange_maps(const EstimationPass& pass) {
    if (group_ == nullptr || group_->size() == 1) return;
    const auto hosts = static_cast<std::size_t>(group_->size());
    // By member and host: whether the host's cameras read the member's map.
    std::vector<std::vector<bool>> is_read(members_.size(), std::vector<bool>(hosts));
    for (std::size_t i = 0; i < members_.size(); ++i) {
      for (const std::size_t other : pass.reads[i]) is_read[other][host_of(i)] = true;
    }
    std::vector<RankCommunicator::Message> messages(hosts);
    for (std::size_t host = 0; host < hosts; ++host) {
      std::size_t bytes = RankCommunicator::kTrailerBytes;
      for (std::size_t i = 0; i < members_.size(); ++i) {
        if (is_solved(i) && is_read[i][host])
          bytes += map(members_[i]).values.size() * sizeof(float);
      }
      if (static_cast<int>(host) != group_->rank()) messages[host].reserve(bytes);
    }
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (!is_solved(i)) continue;
      const auto bytes = std::as_bytes(std::span(map(members_[i]).values));
      for (std::size_t host = 0; host < hosts; ++host) {
        if (!is_read[i][host] || static_cast<int>(host) == group_->rank()) continue;
        messages[host].insert(messages[host].end(), bytes.begin(), bytes.end());
      }
    }
    const std::vector<RankCommunicator::Message> received = group_->exchange(std::move(messages));
    std::vector<std::size_t> taken(hosts);
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const auto from = static_cast<std::size_t>(host_of(i));
      if (is_solved(i) || !is_read[i][group_->rank()]) continue;
      const VirtualCamera& camera = pinhole(members_[i]);
      const std::size_t bytes = pixels_of(camera) * sizeof(float);
      if (received[from].size() - taken[from] < bytes) {
        throw Error::failed("another host sent fewer depths than it should", "method depth",
                            "Check that all hosts run the same program");
      }
      InverseDepthMap& to = depths_.maps[members_[i]];
      to = InverseDepthMap(camera.width, camera.height);
      std::memcpy(to.values.data(), received[from].data() + taken[from], bytes);
      taken[from] += bytes;
    }
    for (std::size_t host = 0; host < hosts; ++host) {
      if (static_cast<int>(host) == group_->rank() || taken[host] == received[host].size())
        continue;
      throw Error::failed("another host sent more depths than it should", "method depth",
                          "Check that all hosts run the same program");
    }
  }

  std::vector<std::vector<std::size_t>> positions_read(int count, Partners partners) const {
    std::vector<std::vector<std::size_t>> reads;
    for (const int camera : members_) {
      reads.emplace_back();
      if (!is_estimated(camera)) continue;
      for (const int other : neighbours(camera, count, partners)) {
        reads.back().push_back(
            static_cast<std::size_t>(std::ranges::lower_bound(members_, other) - members_.begin()));
      }
    }
    return reads;
  }

  matching::CostVolume volume_of(int camera) const {
    return {pinhole(camera).width, pinhole(camera).height,
            initial_sweep_planes(depths_, instant_, camera, options_).count};
  }
  /// Bytes per pixel in addition to the cost volume: seen, guide, planes found and their costs.
  static constexpr std::size_t kSweepBytes = 7;

  /// Returns the memory of the camera that needs most.
  CameraMemory camera_bytes() const {
    constexpr std::size_t kOpenBytes = 14;     // per pixel: a decoded frame and its luma, twice
    constexpr std::size_t kRefineBytes = 44;   // costs, links, smoothed depths
    constexpr std::size_t kMoreToFuse = 24;    // voted depths, support, filled depths
    constexpr std::size_t kPlenty = 200;       // most cost volumes fit in memory
    constexpr std::size_t kOwnBytes = 6;       // the part of the image that is estimated
    constexpr std::size_t kSmall = 1U << 17U;  // tables, weights of tiles, rows
    constexpr std::size_t kTile = 4 * kDepthTile * kDepthTile;
    CameraMemory most;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const int camera = members_[i];
      if (is_read_here_[i]) {
        most.minimum = std::max(most.minimum, kOpenBytes * pixels_of(whole_[camera]));
      }
      if (!is_estimated(camera)) continue;
      const std::size_t pixels = pixels_of(pinhole(camera));
      const auto hypotheses = static_cast<std::size_t>(options_.neighbours) + 1;
      const std::size_t fuse =
          hypotheses * (depth_tile_count(pinhole(camera)) + 2) * kTile + kMoreToFuse * pixels;
      const matching::CostVolume volume = volume_of(camera);
      const std::size_t match = volume.planes > 1 ? matching::semi_global_bytes(volume, 0) : 0;
      const std::size_t passes =
          std::max({kRefineBytes * pixels, fuse, kSweepBytes * pixels + match});
      most.minimum = std::max(most.minimum, kOwnBytes * pixels + passes);
      most.sufficient = std::max(most.sufficient, kPlenty * pixels);
    }
    most.minimum += kSmall;
    return most;
  }

  /// Returns the memory of the camera that uses most if memory is unlimited.
  std::size_t most_used() const {
    std::size_t most = camera_bytes().minimum;
    for (const int camera : members_) {
      const matching::CostVolume volume = volume_of(camera);
      if (!is_estimated(camera) || volume.planes <= 1) continue;
      constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
      constexpr std::size_t kOwnBytes = 6;
      most = std::max(most, (kOwnBytes + kSweepBytes) * pixels_of(pinhole(camera)) +
                                matching::semi_global_bytes(volume, kAll));
    }
    return most;
  }

  /// Counts a part of the work for each camera and pass.
  void count_parts(std::atomic<std::int64_t> StoredDataCounts::*counter, std::int64_t parts) const {
    if (instant_.stored_data_counts != nullptr) instant_.stored_data_counts->*counter += parts;
  }

  /// Replaces all maps by new ones, each computed from the current ones.
  template <class Make>
  void for_each_camera(const EstimationPass& pass, const Make& make) {
    const std::vector<std::size_t> last_readers = pass.last_readers();
    std::vector<InverseDepthMap> made(members_.size());
    for (std::size_t begin = 0; begin < members_.size(); begin += memory_.group) {
      const std::size_t end = std::min(members_.size(), begin + memory_.group);
      hold_images(pass, begin, end);
      parallel_for_in_order(
          end - begin, memory_.in_flight, [] { return false; },
          [&](std::size_t i) {
            if (is_solved(begin + i)) made[begin + i] = make(members_[begin + i]);
            count_parts(&StoredDataCounts::parts_done, 1);
          });
      for (std::size_t i = 0; i < end; ++i) {
        if (made[i].values.empty() || last_readers[i] >= end) continue;
        depths_.maps[members_[i]] = std::exchange(made[i], {});
      }
    }
  }

  /// Loads the matching images that a group reads; drops others unless all fit.
  void hold_images(const EstimationPass& pass, std::size_t begin, std::size_t end) {
    std::vector<bool> is_needed(members_.size());
    if (memory_.group >= members_.size()) is_needed = is_read_here_;
    for (std::size_t i = begin; i < end && pass.images; ++i) {
      if (!is_solved(i)) continue;
      is_needed[i] = true;
      for (const std::size_t other : pass.reads[i]) is_needed[other] = true;
    }
    std::vector<std::vector<int>> missing;  // facets of a fisheye, which share a frame, together
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const int camera = members_[i];
      MatchingImage& held = images_[camera];
      if (!is_needed[i]) held = {};
      if (!is_needed[i] || held.width() > 0) continue;
      if (missing.empty() || !share_a_frame(missing.back().front(), camera)) missing.emplace_back();
      missing.back().push_back(camera);
    }
    parallel_for_in_order(
        missing.size(), memory_.in_flight, [] { return false; },
        [&](std::size_t i) { open_images(missing[i]); });
  }

  bool share_a_frame(int camera, int other) const {
    const std::vector<int>& of_take = instant_.camera_of_take;
    return !of_take.empty() && of_take[camera] == of_take[other];
  }

  /// Loads the matching images of cameras that share a frame.
  void open_images(const std::vector<int>& cameras) {
    std::int64_t decoded = 0;
    const int first = cameras.front();
    const auto frame =
        instant_.opaque_frames().fetch(first, instant_.frame_of_camera[first], {}, decoded);
    pixels_decoded_ += decoded;
    for (const int camera : cameras) {
      images_[camera] = MatchingImage(*frame, instant_.opaque_frames().scale(),
                                      instant_.rig->cameras[camera], whole_[camera]);
    }
  }

  std::vector<NeighbourView> neighbour_views(int camera, int count, Partners partners) const {
    std::vector<NeighbourView> found;
    for (const int other : neighbours(camera, count, partners)) {
      const PixelRectangle part =
          options_.regions.empty() ? PixelRectangle{} : options_.regions[other];
      found.push_back({pixel_transfer(whole_[other], pinhole(camera)), &image(other), &map(other),
                       part.left, part.top});
    }
    return found;
  }

  InverseDepthMap initial_depths(int camera, BufferPool& buffers) const {
    const VirtualCamera& from = pinhole(camera);
    const InitialSweepPlanes planes = initial_sweep_planes(depths_, instant_, camera, options_);
    InverseDepthMap guess(from.width, from.height, kUnknownDepth);
    if (planes.count == 0) return guess;
    const MatchingImage own = own_image(camera);
    const std::vector<std::uint8_t> guide = own.plane();
    if (planes.count == 1) {
      for (std::size_t i = 0; i < guide.size(); ++i) {
        if (guide[i] != 0) guess.values[i] = static_cast<float>(planes.farthest);
      }
      return guess;
    }
    const std::vector<NeighbourView> with =
        neighbour_views(camera, options_.neighbours, Partners::kAll);
    const matching::CostVolume volume{from.width, from.height, planes.count};
    matching::SemiGlobalOptions matching;
    matching.p1 = depth_estimation::kSmallJumpPenalty;
    matching.p2 = depth_estimation::kLargeJumpPenalty;
    matching.guide = guide;
    matching.guide_scale = depth_estimation::kGuideScale;
    matching.buffers = &buffers;
    matching.working_bytes = memory_.each - std::min(memory_.each, kSweepBytes * pixels_of(from));
    std::vector<std::uint8_t> is_seen(pixels_of(from));
    const matching::PlaneMap found = matching::semi_global_match(
        volume,
        [&](int y, std::span<std::uint8_t> costs) {
          MatchRow row;
          row.y = y;
          row.image = &own;
          row.neighbour_views = with;
          row.farthest = planes.farthest;
          row.step = planes.step;
          row.planes = planes.count;
          row.stride = matching::plane_stride(planes.count);
          row.costs = costs.data();
          row.seen = is_seen.data() + static_cast<std::ptrdiff_t>(y) * from.width;
          match_row(row);
        },
        matching);
    for (std::size_t i = 0; i < found.plane.size(); ++i) {
      if (is_seen[i] == 0) continue;
      guess.values[i] =
          static_cast<float>(planes.inverse_depth(static_cast<double>(found.plane[i])));
    }
    return guess;
  }

  float tolerance() const {
    return static_cast<float>(options_.tolerance_px * depths_.inverse_depth_per_pixel);
  }

  InverseDepthMap fused_depths(int camera) const {
    const VirtualCamera& view = pinhole(camera);
    std::vector<DepthHypotheses> hypotheses{
        {&map(camera), &view, uniform_weights(view, depth_estimation::kOwnHypothesisWeight)}};
    for (const int other : neighbours(camera, options_.neighbours, Partners::kEstimated)) {
      hypotheses.push_back({&map(other), &pinhole(other), uniform_weights(view, 1)});
    }
    return reduce_foreground_fattening(
        fuse_hypotheses(view, hypotheses, {tolerance(), depth_estimation::kMinSupport}),
        own_image(camera), neighbour_views(camera, options_.neighbours, Partners::kAll),
        depths_.inverse_depth_per_pixel,
        fattening_reach(instant_.rig->cameras[camera].model.width()));
  }

  EdgeWeights links(const InverseDepthMap& depths, const MatchingImage& picture) const {
    constexpr auto kFloor =
        static_cast<float>(std::numbers::sqrt2 / depth_estimation::kFilterSigmaSpatial);
    constexpr auto kPerCode = static_cast<float>(1 / depth_estimation::kFilterSigmaLuma);
    const auto per_depth = static_cast<float>(
        1 / (depth_estimation::kFilterSigmaDisparity * depths_.inverse_depth_per_pixel));
    EdgeWeights made;
    made.left.resize(depths.values.size());
    made.above.resize(depths.values.size());
    raystage::parallel_for(0, depths.height, [&](int y) {
      for (int x = 0; x < depths.width; ++x) {
        const auto link = [&](int column, int row) {
          if (!picture.is_known(x, y) || !picture.is_known(column, row)) return 0.0F;
          const auto step = static_cast<float>(
              std::abs(static_cast<int>(picture.luma(x, y)) - picture.luma(column, row)));
          const float apart = std::abs(depths.at(x, y) - depths.at(column, row));
          return std::exp(-(kFloor + step * kPerCode + apart * per_depth));
        };
        const std::size_t at = depths.offset(x, y);
        made.left[at] = x > 0 ? link(x - 1, y) : 0;
        made.above[at] = y > 0 ? link(x, y - 1) : 0;
      }
    });
    return made;
  }

  InverseDepthMap refined_depths(int camera) const {
    const MatchingImage picture = own_image(camera);
    const EdgeWeights linked = links(map(camera), picture);
    InverseDepthMap smooth = map(camera);
    domain_transform_filter(smooth.values, 1, smooth.width, smooth.height, linked);
    const std::vector<NeighbourView> with =
        neighbour_views(camera, options_.support_views, Partners::kEstimated);
    const double step = options_.refine_px * depths_.inverse_depth_per_pixel;
    std::vector<float> costs(smooth.values.size() * kRefineOffsetStride);
    raystage::parallel_for(0, smooth.height, [&](int y) {
      const std::size_t row = smooth.offset(0, y);
      RefineRow residuals;
      residuals.y = y;
      residuals.image = &picture;
      residuals.neighbour_views = with;
      residuals.inverse_depth = smooth.values.data() + row;
      residuals.step = step;
      residuals.tolerance = tolerance();
      residuals.costs = costs.data() + row * kRefineOffsetStride;
      refine_row(residuals);
    });
    domain_transform_filter(costs, kRefineOffsetStride, smooth.width, smooth.height, linked);
    for (std::size_t i = 0; i < smooth.values.size(); ++i) {
      // Depths of pixels outside the camera's frame come from others; do not store them here.
      if (map(camera).values[i] < 0 || picture.words()[i] == 0) {
        smooth.values[i] = kUnknownDepth;
        continue;
      }
      const float offset = best_offset(costs.data() + i * kRefineOffsetStride);
      smooth.values[i] = std::max(0.0F, smooth.values[i] + offset * static_cast<float>(step));
    }
    return smooth;
  }

  /// Returns the offset of the lowest cost, in steps (of equals the middle), refined by a parabola.
  static float best_offset(const float* cost) {
    int best = kRefineOffsets / 2;
    for (int i = 0; i < kRefineOffsets; ++i)
      if (cost[i] < cost[best]) best = i;
    const int steps = best - kRefineOffsets / 2;
    auto offset = static_cast<float>(steps);
    if (best == 0 || best == kRefineOffsets - 1) return offset;
    const float before = cost[best - 1] - cost[best], after = cost[best + 1] - cost[best];
    if (before + after > 1e-6F) offset += 0.5F * (before - after) / (before + after);
    return offset;
  }

  const LightFieldFrame& instant_;
  const DepthEstimationOptions& options_;
  const RankCommunicator* group_;
  CameraDepths depths_;
  std::vector<bool> is_read_here_;     // by member: a camera of this host reads its image
  std::vector<VirtualCamera> whole_;   // by camera of the rig: undistorted()
  std::vector<MatchingImage> images_;  // of these
  std::vector<int> members_;
  EstimationPass initial_pass_, fusion_pass_, refinement_pass_;
  EstimationMemory memory_;
  std::atomic<std::int64_t> pixels_decoded_ = 0;
};

}  // namespace

void CameraDepths::compute_block_nearest() {
  block_nearest.resize(maps.size());
  raystage::parallel_for(std::size_t{0}, maps.size(),
                         [&](std::size_t i) { block_nearest[i] = block_nearest_depths(maps[i]); });
}

std::size_t CameraDepths::bytes() const {
  std::size_t sum = 0;
  for (const auto& kept : {std::cref(maps), std::cref(block_nearest)}) {
    for (const InverseDepthMap& map : kept.get()) sum += map.values.size() * sizeof(float);
  }
  return sum;
}

bool DepthEstimationOptions::is_valid(std::string* reason) const {
  using namespace depth_estimation;
  return is_within("plane_px", plane_px, 1e-3, 1000, reason) &&
         is_within("neighbours", neighbours, 1, kMaxNeighbours, reason) &&
         is_within("support_views", support_views, 1, 10000, reason) &&
         is_within("refine_px", refine_px, 1e-6, 1000, reason) &&
         is_within("tolerance_px", tolerance_px, 1e-6, 1000, reason);
}

CameraDepths estimate_camera_depths(const LightFieldFrame& instant,
                                    const DepthEstimationOptions& options,
                                    std::size_t working_bytes) {
  require_valid(options, "depth estimation");
  return Solver(instant, options, working_bytes, nullptr).solve();
}

CameraDepths estimate_local_depths(const LightFieldFrame& instant,
                                   const DepthEstimationOptions& options, std::size_t working_bytes,
                                   const RankCommunicator& group) {
  require_valid(options, "depth estimation");
  return Solver(instant, options, working_bytes, &group).solve();
}

}  // namespace raystage::render
