// SPDX-License-Identifier: Apache-2.0
#include "render/depth/camera_depths.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "render/depth/fusion.h"
#include "render/depth/matching_image.h"
#include "render/depth/solve_kernels.h"
#include "render/matching/matching.h"
#include "schemas/parallel.h"

namespace raystage {
namespace {

std::size_t pixels_of(const VirtualCamera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

/// Pixels that a point moves by from one camera to another, per 1/m.
double disparity(const VirtualCamera& to, const VirtualCamera& from) {
  const PixelTransfer transfer = pixel_transfer(to, from);
  return std::hypot(transfer.parallax[0], transfer.parallax[1]);
}

/// Whether `other` sees some of what `camera` does in the middle of the scene.
bool share_a_view(const VirtualCamera& camera, const VirtualCamera& other,
                  const InverseDepthRange& range) {
  const PixelTransfer transfer = pixel_transfer(other, camera);
  const double q = (range.farthest + range.nearest) / 2;
  for (int i = 0; i < 9; ++i) {
    const int column = 1 + i % 3, row = 1 + i / 3;
    const double x = camera.width * column / 4.0, y = camera.height * row / 4.0;
    const auto part = [&](std::size_t r) {
      const double* m = transfer.direction.data() + 3 * r;
      return m[0] * x + m[1] * y + m[2] + q * transfer.parallax[r];
    };
    const double w = part(2), u = part(0), v = part(1);
    if (w > 0 && u >= 0 && v >= 0 && u <= w * other.width && v <= w * other.height) return true;
  }
  return false;
}

/// What takes part in solving one instant.
class Solver {
 public:
  Solver(const Instant& instant, const DepthSettings& settings, std::size_t working_bytes)
      : instant_(instant),
        settings_(settings),
        depths_(depth_cameras(instant, settings)),
        images_(depths_.pinholes.size()) {
    std::size_t most = 1;
    for (std::size_t i = 0; i < images_.size(); ++i) {
      if (!instant.is_present(static_cast<int>(i))) continue;
      members_.push_back(static_cast<int>(i));
      most = std::max(most, pixels_of(depths_.pinholes[i]));
    }
    // Warped maps, costs of refinement, a cost volume of a moderate number of planes.
    constexpr std::size_t kBytesPerPixel = 200;
    in_flight_ = std::clamp<std::size_t>(working_bytes / (most * kBytesPerPixel), 1, 64);
    matching_bytes_ = working_bytes / in_flight_;
  }

  CameraDepths solve() {
    open_images();
    for_each_camera([&](int camera) { return first_guess(camera); });
    if (depths_.pixel > 0) {
      for_each_camera([&](int camera) { return agreed(camera); });
      for_each_camera([&](int camera) { return refined(camera); });
    }
    return std::move(depths_);
  }

 private:
  const VirtualCamera& pinhole(int camera) const {
    return depths_.pinholes[static_cast<std::size_t>(camera)];
  }
  const InverseDepthMap& map(int camera) const {
    return depths_.maps[static_cast<std::size_t>(camera)];
  }
  const MatchingImage& image(int camera) const { return images_[static_cast<std::size_t>(camera)]; }
  InverseDepthRange range(int camera) const {
    return inverse_depths_in_view(pinhole(camera), *instant_.rig, settings_.scene);
  }
  std::vector<int> neighbours(int camera, int count) const {
    return depth_neighbours(depths_, instant_, camera, range(camera), count);
  }

  /// All maps anew, each from all of the present ones.
  template <class Make>
  void for_each_camera(const Make& make) {
    std::vector<InverseDepthMap> made(depths_.maps.size());
    for_each_in_flight(
        members_.size(), in_flight_, [] { return false; },
        [&](std::size_t i) { made[static_cast<std::size_t>(members_[i])] = make(members_[i]); });
    depths_.maps = std::move(made);
  }

  void open_images() {
    raystage::parallel_for(std::size_t{0}, members_.size(), [&](std::size_t i) {
      const auto camera = static_cast<std::size_t>(members_[i]);
      std::int64_t decoded = 0;
      const auto frame =
          instant_.cache->fetch(members_[i], instant_.frame_of_camera[camera], {}, decoded);
      images_[camera] = MatchingImage(*frame, instant_.cache->blend_space(),
                                      instant_.rig->cameras[camera], depths_.pinholes[camera]);
    });
  }

  std::vector<Partner> partners(int camera, int count) const {
    std::vector<Partner> found;
    for (const int other : neighbours(camera, count)) {
      found.push_back(
          {pixel_transfer(pinhole(other), pinhole(camera)), &image(other), &map(other)});
    }
    return found;
  }

  InverseDepthMap first_guess(int camera) const {
    const VirtualCamera& from = pinhole(camera);
    const GuessPlanes planes = guess_planes(depths_, instant_, camera, settings_);
    InverseDepthMap guess{from.width, from.height, {}};
    if (planes.count == 0) {
      guess.values.assign(pixels_of(from), kUnknownDepth);
      return guess;
    }
    if (planes.count == 1) {
      for (const std::uint8_t luma : image(camera).plane()) {
        guess.values.push_back(luma == 0 ? kUnknownDepth : static_cast<float>(planes.farthest));
      }
      return guess;
    }
    const std::vector<Partner> with = partners(camera, settings_.neighbours);
    const CostVolume volume{from.width, from.height, planes.count};
    const std::vector<std::uint8_t> guide = image(camera).plane();
    SemiGlobalSettings matching;
    matching.p1 = depth_solve::kOnePlane;
    matching.p2 = depth_solve::kJump;
    matching.guide = guide;
    matching.guide_scale = depth_solve::kGuideCodes;
    matching.working_bytes = matching_bytes_;
    std::vector<std::uint8_t> is_seen(pixels_of(from));
    const PlaneMap found = semi_global_match(
        volume,
        [&](int y, std::span<std::uint8_t> costs) {
          MatchRow row;
          row.y = y;
          row.image = &image(camera);
          row.partners = with;
          row.farthest = planes.farthest;
          row.step = planes.step;
          row.planes = planes.count;
          row.stride = plane_stride(planes.count);
          row.costs = costs.data();
          row.seen = is_seen.data() + static_cast<std::ptrdiff_t>(y) * from.width;
          match_row(row);
        },
        matching);
    guess.values.reserve(found.plane.size());
    for (std::size_t i = 0; i < found.plane.size(); ++i) {
      const double depth = planes.inverse_depth(static_cast<double>(found.plane[i]));
      guess.values.push_back(is_seen[i] == 0 ? kUnknownDepth : static_cast<float>(depth));
    }
    return guess;
  }

  float tolerance() const { return static_cast<float>(settings_.tolerance_px * depths_.pixel); }

  InverseDepthMap agreed(int camera) const {
    const VirtualCamera& view = pinhole(camera);
    std::vector<DepthReport> reports{
        {&map(camera), &view, even_weights(view, depth_solve::kOwnReport)}};
    for (const int other : neighbours(camera, settings_.neighbours)) {
      reports.push_back({&map(other), &pinhole(other), even_weights(view, 1)});
    }
    return fuse_depths(view, reports, {tolerance(), depth_solve::kLeastAgreeing});
  }

  PixelLinks links(const InverseDepthMap& depths, const MatchingImage& picture) const {
    constexpr auto kFloor = static_cast<float>(std::numbers::sqrt2 / depth_solve::kLinkReach);
    constexpr auto kPerCode = static_cast<float>(1 / depth_solve::kLinkCodes);
    const auto per_depth = static_cast<float>(1 / (depth_solve::kLinkDisparity * depths_.pixel));
    PixelLinks made;
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
        const std::size_t at =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(depths.width) +
            static_cast<std::size_t>(x);
        made.left[at] = x > 0 ? link(x - 1, y) : 0;
        made.above[at] = y > 0 ? link(x, y - 1) : 0;
      }
    });
    return made;
  }

  InverseDepthMap refined(int camera) const {
    const MatchingImage& picture = image(camera);
    const PixelLinks linked = links(map(camera), picture);
    InverseDepthMap smooth = map(camera);
    smooth_along_links(smooth.values, 1, smooth.width, smooth.height, linked);
    const std::vector<Partner> with = partners(camera, settings_.witnesses);
    const double step = settings_.refine_px * depths_.pixel;
    std::vector<float> costs(smooth.values.size() * kOffsetStride);
    raystage::parallel_for(0, smooth.height, [&](int y) {
      const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(smooth.width);
      RefineRow residuals;
      residuals.y = y;
      residuals.image = &picture;
      residuals.partners = with;
      residuals.present = smooth.values.data() + row;
      residuals.step = step;
      residuals.tolerance = tolerance();
      residuals.costs = costs.data() + row * kOffsetStride;
      refine_row(residuals);
    });
    smooth_along_links(costs, kOffsetStride, smooth.width, smooth.height, linked);
    for (std::size_t i = 0; i < smooth.values.size(); ++i) {
      // Others may have seen what this one's frame does not show: that is for them to tell.
      if (map(camera).values[i] < 0 || picture.words()[i] == 0) {
        smooth.values[i] = kUnknownDepth;
        continue;
      }
      const float offset = best_offset(costs.data() + i * kOffsetStride);
      smooth.values[i] = std::max(0.0F, smooth.values[i] + offset * static_cast<float>(step));
    }
    return smooth;
  }

  /// Of the least cost, the middle first; between steps by the parabola through three.
  static float best_offset(const float* cost) {
    int best = kOffsets / 2;
    for (int i = 0; i < kOffsets; ++i) {
      if (cost[i] < cost[best]) best = i;
    }
    const int steps = best - kOffsets / 2;
    auto offset = static_cast<float>(steps);
    if (best == 0 || best == kOffsets - 1) return offset;
    const float before = cost[best - 1] - cost[best], after = cost[best + 1] - cost[best];
    if (before + after > 1e-6F) offset += 0.5F * (before - after) / (before + after);
    return offset;
  }

  const Instant& instant_;
  const DepthSettings& settings_;
  CameraDepths depths_;
  std::vector<MatchingImage> images_;  // by camera of the rig
  std::vector<int> members_;
  std::size_t in_flight_ = 1, matching_bytes_ = 0;
};

}  // namespace

void CameraDepths::find_nearest() {
  nearest.resize(maps.size());
  raystage::parallel_for(std::size_t{0}, maps.size(),
                         [&](std::size_t i) { nearest[i] = nearest_of_blocks(maps[i]); });
}

std::size_t CameraDepths::bytes() const {
  std::size_t sum = 0;
  for (const auto& kept : {std::cref(maps), std::cref(nearest)}) {
    for (const InverseDepthMap& map : kept.get()) sum += map.values.size() * sizeof(float);
  }
  return sum;
}

std::vector<int> depth_neighbours(const CameraDepths& depths, const Instant& instant, int camera,
                                  const InverseDepthRange& range, int count) {
  const VirtualCamera& from = depths.pinholes[static_cast<std::size_t>(camera)];
  std::vector<std::pair<double, int>> others;
  for (std::size_t i = 0; i < depths.pinholes.size(); ++i) {
    const int other = static_cast<int>(i);
    if (other == camera || !instant.is_present(other)) continue;
    const double distance = (depths.pinholes[i].pose.position - from.pose.position).norm();
    if (!(disparity(depths.pinholes[i], from) > 0)) continue;
    if (share_a_view(from, depths.pinholes[i], range)) others.emplace_back(distance, other);
  }
  std::ranges::sort(others);
  others.resize(std::min(others.size(), static_cast<std::size_t>(count)));
  std::vector<int> nearest;
  for (const auto& [distance, other] : others) nearest.push_back(other);
  return nearest;
}

GuessPlanes guess_planes(const CameraDepths& depths, const Instant& instant, int camera,
                         const DepthSettings& settings) {
  const VirtualCamera& from = depths.pinholes[static_cast<std::size_t>(camera)];
  const InverseDepthRange seen = inverse_depths_in_view(from, *instant.rig, settings.scene);
  if (seen.empty()) return {};
  const std::vector<int> nearest = depth_neighbours(depths, instant, camera, seen, 1);
  const double moves =
      nearest.empty() ? 0 : disparity(depths.pinholes[static_cast<std::size_t>(nearest[0])], from);
  const double steps = std::ceil((seen.nearest - seen.farthest) * moves / settings.plane_px - 1e-9);
  const int count = 1 + static_cast<int>(std::clamp(steps, 0.0, depth_solve::kMostPlanes - 1.0));
  if (count == 1) return {1, (seen.farthest + seen.nearest) / 2, 0};
  return {count, seen.farthest, (seen.nearest - seen.farthest) / (count - 1)};
}

CameraDepths depth_cameras(const Instant& instant, const DepthSettings& settings) {
  CameraDepths depths;
  for (const Rig::Camera& camera : instant.rig->cameras) {
    depths.pinholes.push_back(undistorted(camera.model, camera.pose));
  }
  depths.maps.resize(depths.pinholes.size());
  std::vector<double> moves;
  for (std::size_t i = 0; i < depths.pinholes.size(); ++i) {
    if (!instant.is_present(static_cast<int>(i))) continue;
    const InverseDepthRange range =
        inverse_depths_in_view(depths.pinholes[i], *instant.rig, settings.scene);
    const auto nearest = depth_neighbours(depths, instant, static_cast<int>(i), range, 1);
    if (nearest.empty()) continue;
    moves.push_back(
        disparity(depths.pinholes[static_cast<std::size_t>(nearest[0])], depths.pinholes[i]));
  }
  if (moves.empty()) return depths;
  const auto middle = moves.begin() + static_cast<std::ptrdiff_t>(moves.size() / 2);
  std::nth_element(moves.begin(), middle, moves.end());
  depths.pixel = 1 / *middle;
  return depths;
}

CameraDepths solve_camera_depths(const Instant& instant, const DepthSettings& settings,
                                 std::size_t working_bytes) {
  return Solver(instant, settings, working_bytes).solve();
}

}  // namespace raystage
