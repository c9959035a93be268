// SPDX-License-Identifier: Apache-2.0
// Reference of estimate_camera_depths() (camera_depths.cpp, matching_image.cpp, fusion.cpp and the
// estimation kernels): matching, fusion and refinement pixel by pixel in double, on one thread,
// with all data in memory. Output: inverse depth maps in 1/m. Cost per camera: O(pixels x planes x
// neighbours) as the kernels, without vectors.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "base/transfer_function.h"
#include "matching/matching.h"
#include "render/depth/camera_depths.h"
#include "render/depth/estimation_kernels.h"
#include "render/depth/foreground_fattening.h"
#include "render/depth/fusion.h"
#include "store/processing/frames/matching_code.h"

namespace raystage::render {
namespace {

using Plane = Image<double>;

/// Returns the bilinear value; border pixels are repeated outwards.
double bilinear(const Plane& plane, double u, double v) {
  const double x = std::clamp(u - 0.5, 0.0, plane.width - 1.0);
  const double y = std::clamp(v - 0.5, 0.0, plane.height - 1.0);
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const double right = x - left, down = y - top;
  return (1 - down) * ((1 - right) * plane.at(left, top) + right * plane.clamped(left + 1, top)) +
         down * ((1 - right) * plane.clamped(left, top + 1) +
                 right * plane.clamped(left + 1, top + 1));
}

/// See MatchingImage.
struct Picture {
  Plane luma;                         ///< -1 if the frame does not show the pixel
  Plane blue, red;                    ///< less luma, halved, around 128
  Image<std::uint8_t> is_shown = {};  ///< of a part: whether shows_pixel(); else empty

  bool shows(double u, double v) const {
    const int x = static_cast<int>(std::clamp(u - 0.5, 0.0, luma.width - 1.0));
    const int y = static_cast<int>(std::clamp(v - 0.5, 0.0, luma.height - 1.0));
    return luma.at(x, y) >= 0 && luma.clamped(x + 1, y) >= 0 && luma.clamped(x, y + 1) >= 0 &&
           luma.clamped(x + 1, y + 1) >= 0;
  }
  bool shows_pixel(int x, int y) const {
    return is_shown.values.empty() ? shows(x + 0.5, y + 0.5) : is_shown.at(x, y) != 0;
  }

  /// Returns a part; shows_pixel() still regards the pixels right of it and below it.
  Picture part(const PixelRectangle& region) const {
    const auto part_of = [&](const Plane& plane) {
      Plane made(region.right - region.left, region.bottom - region.top);
      for (int y = 0; y < made.height; ++y) {
        for (int x = 0; x < made.width; ++x) {
          made.at(x, y) = plane.at(region.left + x, region.top + y);
        }
      }
      return made;
    };
    Picture made{part_of(luma), part_of(blue), part_of(red)};
    made.is_shown = Image<std::uint8_t>(made.luma.width, made.luma.height);
    for (int y = 0; y < made.luma.height; ++y) {
      for (int x = 0; x < made.luma.width; ++x) {
        made.is_shown.at(x, y) = shows_pixel(region.left + x, region.top + y) ? 1 : 0;
      }
    }
    return made;
  }
};

Picture picture_of(const store::DecodedFrame& frame, const store::CodeScale& scale,
                   const rig::CameraModel& model, const VirtualCamera& pinhole) {
  Plane luma(frame.width, frame.height, 0), blue = luma, red = luma;
  const auto code = [&](std::size_t i) {
    if (scale.space == store::BlendSpace::kHighRange) {
      const double light =
          scale.full_scale * store::part_from_value(scale.space, frame.rgba[i] / 65535.0);
      return 255 * store::matching_code(scale, light);
    }
    const int upper_bits = frame.rgba[i] >> 4U;  // 12 of 16
    const double upper = upper_bits / 4095.0;
    return 255 * (scale.space == store::BlendSpace::kLinear ? srgb_from_linear(upper) : upper);
  };
  for (std::size_t i = 0; i < luma.values.size(); ++i) {
    const double y = 0.299 * code(4 * i) + 0.587 * code(4 * i + 1) + 0.114 * code(4 * i + 2);
    luma.values[i] = std::max(1.0, std::floor(y + 0.5));
    red.values[i] = std::clamp(std::floor((code(4 * i) - y) / 2 + 128.5), 0.0, 255.0);
    blue.values[i] = std::clamp(std::floor((code(4 * i + 2) - y) / 2 + 128.5), 0.0, 255.0);
  }
  if (!model.has_distortion()) return {luma, blue, red};
  const Plane unknown(pinhole.width, pinhole.height, -1);
  Picture straight{unknown, unknown, unknown};
  const schemas::Intrinsics& k = pinhole.intrinsics;
  for (int y = 0; y < pinhole.height; ++y) {
    for (int x = 0; x < pinhole.width; ++x) {
      const auto pixel = model.pixel_from_ideal({(x + 0.5 - k.cx) / k.fx, (y + 0.5 - k.cy) / k.fy});
      if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > frame.width ||
          pixel->y() > frame.height) {
        continue;
      }
      const auto resampled = [&](const Plane& plane) {
        return std::floor(bilinear(plane, pixel->x(), pixel->y()) + 0.5);
      };
      straight.luma.at(x, y) = resampled(luma);
      straight.blue.at(x, y) = resampled(blue);
      straight.red.at(x, y) = resampled(red);
    }
  }
  return straight;
}

struct Place {
  double u = 0, v = 0, inverse_depth = 0;
};
std::optional<Place> place_of(const VirtualCamera& to, const VirtualCamera& from, int x, int y,
                              double q) {
  const PixelTransfer t = pixel_transfer(to, from);
  std::array<double, 3> p{};
  for (std::size_t r = 0; r < 3; ++r) {
    p[r] = t.direction[3 * r] * (x + 0.5) + t.direction[3 * r + 1] * (y + 0.5) +
           t.direction[3 * r + 2] + q * t.parallax[r];
  }
  const Place place{p[0] / p[2], p[1] / p[2], q / p[2]};
  const bool is_inside =
      p[2] > 0 && place.u >= 0 && place.v >= 0 && place.u <= to.width && place.v <= to.height;
  return is_inside ? std::optional(place) : std::nullopt;
}

class Reference {
 public:
  Reference(const LightFieldFrame& instant, const DepthEstimationOptions& options)
      : instant_(instant),
        options_(options),
        depths_(camera_depths_without_maps(instant, options)) {
    for (std::size_t i = 0; i < depths_.pinholes.size(); ++i) {
      pictures_.emplace_back();
      whole_pictures_.emplace_back();
      whole_.push_back(undistorted(instant.rig->cameras[i].model, instant.rig->cameras[i].pose));
      if (!instant.is_present(static_cast<int>(i))) continue;
      std::int64_t decoded = 0;
      const auto frame = instant.opaque_frames().fetch(static_cast<int>(i),
                                                       instant.frame_of_camera[i], {}, decoded);
      whole_pictures_[i] = picture_of(*frame, instant.opaque_frames().scale(),
                                      instant.rig->cameras[i].model, whole_[i]);
      pictures_[i] = options.regions.empty() || options.regions[i].is_empty()
                         ? whole_pictures_[i]
                         : whole_pictures_[i].part(options.regions[i]);
    }
  }

  CameraDepths solve() {
    for_each_camera([&](int camera) { return first_guess(camera); });
    if (depths_.inverse_depth_per_pixel > 0) {
      for_each_camera([&](int camera) { return agreed(camera); });
      for_each_camera([&](int camera) { return refined(camera); });
    }
    return depths_;
  }

 private:
  template <class Make>
  void for_each_camera(const Make& make) {
    std::vector<InverseDepthMap> made(depths_.maps.size());
    for (std::size_t i = 0; i < made.size(); ++i) {
      const int camera = static_cast<int>(i);
      if (instant_.is_present(camera) && is_estimated(camera)) made[i] = make(camera);
    }
    depths_.maps = made;
  }
  const VirtualCamera& pinhole(int camera) const { return depths_.pinholes[camera]; }
  const Picture& picture(int camera) const { return pictures_[camera]; }
  const InverseDepthMap& map(int camera) const { return depths_.maps[camera]; }
  bool is_estimated(int camera) const { return has_region(options_.regions, camera); }
  std::vector<int> neighbours(int camera, int count) const {
    const InverseDepthRange range =
        inverse_depth_range_in_view(pinhole(camera), *instant_.rig, options_.scene);
    return depth_neighbours(depths_, instant_, camera, range, count);
  }
  /// Returns the nearest cameras that have depths.
  std::vector<int> estimated_neighbours(int camera, int count) const {
    std::vector<int> found;
    for (const int other : neighbours(camera, static_cast<int>(depths_.maps.size()))) {
      if (is_estimated(other) && std::ssize(found) < count) found.push_back(other);
    }
    return found;
  }

  InverseDepthMap first_guess(int camera) const {
    const VirtualCamera& from = pinhole(camera);
    const Picture& own = picture(camera);
    const InitialSweepPlanes planes = initial_sweep_planes(depths_, instant_, camera, options_);
    Plane is_seen(from.width, from.height, planes.count == 1 ? 1 : 0);
    const matching::FillCosts fill = [&](int y, std::span<std::uint8_t> costs) {
      for (int x = 0; x < from.width; ++x) {
        for (int plane = 0; plane < planes.count; ++plane) {
          const auto cost = guess_cost(camera, x, y, planes.inverse_depth(plane));
          if (cost) is_seen.at(x, y) = 1;
          costs[x * matching::plane_stride(planes.count) + plane] =
              cost ? static_cast<std::uint8_t>(std::lround(*cost)) : matching::kUnknownCost;
        }
      }
    };
    std::vector<std::uint8_t> guide;
    for (int i = 0; i < from.width * from.height; ++i) {
      const int x = i % from.width, y = i / from.width;
      guide.push_back(own.shows_pixel(x, y) ? static_cast<std::uint8_t>(own.luma.at(x, y))
                                            : std::uint8_t{0});
    }
    matching::SemiGlobalOptions matching;
    matching.p1 = depth_estimation::kSmallJumpPenalty;
    matching.p2 = depth_estimation::kLargeJumpPenalty;
    matching.guide = guide;
    matching.guide_scale = depth_estimation::kGuideScale;
    matching::PlaneMap found(from.width, from.height);
    if (planes.count > 1) {
      found = matching::semi_global_match_reference({from.width, from.height, planes.count}, fill,
                                                    matching);
    }
    InverseDepthMap guess(from.width, from.height, kUnknownDepth);
    for (int i = 0; i < from.width * from.height; ++i) {
      const int x = i % from.width, y = i / from.width;
      if (planes.count == 0 || !own.shows_pixel(x, y) || !(is_seen.at(x, y) > 0)) continue;
      const auto plane = static_cast<double>(found.plane[i]);
      guess.values[i] = static_cast<float>(planes.inverse_depth(plane));
    }
    return guess;
  }

  /// Returns the mean of the smaller half of the differences to the neighbours, codes, or nullopt
  /// if none sees the point.
  std::optional<double> luma_difference(
      int camera, int x, int y, double depth, std::span<const int> others,
      double truncation = std::numeric_limits<double>::infinity()) const {
    const Picture& own = picture(camera);
    std::vector<double> differences;
    for (const int other : others) {
      const auto at = place_of(whole_[other], pinhole(camera), x, y, depth);
      const Picture& its = whole_pictures_[other];
      if (!at || !own.shows_pixel(x, y) || !its.shows(at->u, at->v)) continue;
      const double off = bilinear(its.luma, at->u, at->v) - own.luma.at(x, y);
      differences.push_back(std::min(std::abs(off), truncation));
    }
    if (differences.empty()) return std::nullopt;
    std::ranges::sort(differences);
    differences.resize((differences.size() + 1) / 2);
    double sum = 0;
    for (const double difference : differences) sum += difference;
    return sum / static_cast<double>(differences.size());
  }

  /// Returns the cost of match_row(), or nullopt if no neighbour sees the point.
  std::optional<double> guess_cost(int camera, int x, int y, double depth) const {
    constexpr double kTruncation = 40;  // codes of 255
    const auto difference =
        luma_difference(camera, x, y, depth, neighbours(camera, options_.neighbours), kTruncation);
    return difference ? std::optional(255 / kTruncation * *difference) : std::nullopt;
  }

  InverseDepthMap agreed(int camera) const {
    const VirtualCamera& view = pinhole(camera);
    std::vector<DepthHypotheses> hypotheses{
        {&map(camera), &view, uniform_weights(view, depth_estimation::kOwnHypothesisWeight)}};
    for (const int other : estimated_neighbours(camera, options_.neighbours)) {
      hypotheses.push_back({&map(other), &pinhole(other), uniform_weights(view, 1)});
    }
    InverseDepthMap fused = fuse_hypotheses_reference(
        view, hypotheses,
        {static_cast<float>(options_.tolerance_px * depths_.inverse_depth_per_pixel),
         depth_estimation::kMinSupport});
    for (int i = 0; i < foreground_fattening::kRounds; ++i) fused = less_fattened(camera, fused);
    return fused;
  }

  /// See reduce_foreground_fattening(): one round.
  InverseDepthMap less_fattened(int camera, const InverseDepthMap& depths) const {
    using namespace foreground_fattening;
    const Picture& own = picture(camera);
    const int reach = fattening_reach(instant_.rig->cameras[camera].model.width());
    const std::vector<int> others = neighbours(camera, options_.neighbours);
    const auto apart = static_cast<float>(kApartPx * depths_.inverse_depth_per_pixel);
    InverseDepthMap behind(depths.width, depths.height, kUnknownDepth);
    Plane worse(depths.width, depths.height, 0);
    for (int y = 0; y < depths.height; ++y) {
      for (int x = 0; x < depths.width; ++x) {
        const float depth = depths.at(x, y);
        if (depth < 0 || !own.shows_pixel(x, y)) continue;
        // The first pixel of the same colour that is far enough, and its distance.
        struct Found {
          float depth = kUnknownDepth;
          int distance = 0;
        };
        const auto look = [&](int dx, int dy) {
          for (int i = 1; i <= reach; ++i) {
            const int column = x + i * dx, row = y + i * dy;
            if (!depths.contains(column, row)) break;
            const float there = depths.at(column, row);
            if (there < 0 || there > depth - apart || !own.shows_pixel(column, row)) continue;
            const auto apart_by = [&](const Plane& plane) {
              return std::abs(plane.at(column, row) - plane.at(x, y));
            };
            if (apart_by(own.luma) <= kSameColour &&
                apart_by(own.blue) + apart_by(own.red) <= kSameColour) {
              return Found{there, i};
            }
          }
          return Found{};
        };
        std::vector<float> candidates, between;
        for (const auto& [dx, dy] : {std::pair(1, 0), {0, 1}, {1, 1}, {1, -1}}) {
          const Found ahead = look(dx, dy), back = look(-dx, -dy);
          for (const Found& found : {ahead, back}) {
            if (found.distance > 0) candidates.push_back(found.depth);
          }
          if (ahead.distance == 0 || back.distance == 0) continue;
          const float part = static_cast<float>(ahead.distance) /
                             static_cast<float>(ahead.distance + back.distance);
          between.push_back(ahead.depth + part * (back.depth - ahead.depth));
        }
        if (candidates.size() < kDirections) continue;
        candidates.insert(candidates.end(), between.begin(), between.end());
        std::optional<double> least;
        for (const float candidate : candidates) {
          const auto found = luma_difference(camera, x, y, static_cast<double>(candidate), others);
          if (!found || (least && *found >= *least - kBetter)) continue;
          least = found;
          behind.at(x, y) = candidate;
        }
        const auto now = luma_difference(camera, x, y, static_cast<double>(depth), others);
        constexpr double kInfinity = std::numeric_limits<double>::infinity();
        if (least) worse.at(x, y) = now ? *least - *now : -kInfinity;
      }
    }
    InverseDepthMap result = depths;
    for (int y = 0; y < depths.height; ++y) {
      for (int x = 0; x < depths.width; ++x) {
        if (behind.at(x, y) < 0 || worse.at(x, y) > kSlack) continue;
        std::vector<double> around;
        for (int row = y - kMeanRadius; row <= y + kMeanRadius; ++row) {
          for (int column = x - kMeanRadius; column <= x + kMeanRadius; ++column) {
            if (behind.contains(column, row) && behind.at(column, row) >= 0) {
              around.push_back(std::clamp(worse.at(column, row), -10.0, 10.0));
            }
          }
        }
        double sum = 0;
        for (const double value : around) sum += value;
        if (sum / static_cast<double>(around.size()) <= kMeanSlack) {
          result.at(x, y) = behind.at(x, y);
        }
      }
    }
    return result;
  }

  float link(int camera, int x, int y, int other_x, int other_y) const {
    const Picture& own = picture(camera);
    if (other_x < 0 || other_y < 0) return 0;
    if (!own.shows_pixel(x, y) || !own.shows_pixel(other_x, other_y)) return 0;
    const double codes = std::abs(own.luma.at(x, y) - own.luma.at(other_x, other_y));
    const double apart = std::abs(static_cast<double>(map(camera).at(x, y)) -
                                  static_cast<double>(map(camera).at(other_x, other_y)));
    return static_cast<float>(std::exp(
        -(std::numbers::sqrt2 / depth_estimation::kFilterSigmaSpatial +
          codes / depth_estimation::kFilterSigmaLuma +
          apart / depths_.inverse_depth_per_pixel / depth_estimation::kFilterSigmaDisparity)));
  }

  InverseDepthMap refined(int camera) const {
    InverseDepthMap result = map(camera);
    const int width = result.width, height = result.height;
    EdgeWeights links;
    for (int i = 0; i < width * height; ++i) {
      const int x = i % width, y = i / width;
      links.left.push_back(link(camera, x, y, x - 1, y));
      links.above.push_back(link(camera, x, y, x, y - 1));
    }
    domain_transform_filter_reference(result.values, 1, width, height, links);
    std::vector<float> costs;
    for (int i = 0; i < width * height; ++i) {
      for (const double cost : refine_costs(camera, i % width, i / width,
                                            static_cast<double>(result.at(i % width, i / width)))) {
        costs.push_back(static_cast<float>(cost));
      }
    }
    domain_transform_filter_reference(costs, kRefineOffsets, width, height, links);
    for (int i = 0; i < width * height; ++i) {
      float& depth = result.values[i];
      if (map(camera).at(i % width, i / width) < 0 ||
          !picture(camera).shows_pixel(i % width, i / width)) {
        depth = kUnknownDepth;
        continue;
      }
      const double offset = best_offset(
          std::span(costs).subspan(static_cast<std::size_t>(i) * kRefineOffsets, kRefineOffsets));
      depth = static_cast<float>(std::max(0.0, static_cast<double>(depth) + offset * step()));
    }
    return result;
  }

  double step() const { return options_.refine_px * depths_.inverse_depth_per_pixel; }

  std::array<double, kRefineOffsets> refine_costs(int camera, int x, int y, double present) const {
    constexpr double kTruncation = 15;  // codes of 255
    const VirtualCamera& from = pinhole(camera);
    const Picture& own = picture(camera);
    std::array<double, kRefineOffsets> costs{};
    int count = 0;
    for (const int other : estimated_neighbours(camera, options_.support_views)) {
      const auto at = place_of(whole_[other], from, x, y, present);
      if (!at) continue;
      const PixelRectangle part =
          options_.regions.empty() ? PixelRectangle{} : options_.regions[other];
      const InverseDepthMap& depths = map(other);
      const double u = at->u - part.left, v = at->v - part.top;
      const bool has_depth = u >= 0 && v >= 0 && u <= depths.width && v <= depths.height;
      const double its =
          has_depth
              ? static_cast<double>(depths.at(std::min(static_cast<int>(u), depths.width - 1),
                                              std::min(static_cast<int>(v), depths.height - 1)))
              : -1;
      if (its > at->inverse_depth + options_.tolerance_px * depths_.inverse_depth_per_pixel)
        continue;
      std::vector<double> tried;
      for (int i = -kRefineOffsets / 2; i <= kRefineOffsets / 2; ++i) {
        const auto moved = place_of(whole_[other], from, x, y, present + i * step());
        const Picture& theirs = whole_pictures_[other];
        if (!moved || !own.shows_pixel(x, y) || !theirs.shows(moved->u, moved->v)) break;
        const double off = bilinear(theirs.luma, moved->u, moved->v) - own.luma.at(x, y);
        tried.push_back(off * off / (1 + off * off / (kTruncation * kTruncation)));
      }
      if (tried.size() < kRefineOffsets) continue;
      ++count;
      for (std::size_t i = 0; i < kRefineOffsets; ++i) costs[i] += tried[i];
    }
    for (double& cost : costs) cost /= std::max(1, count);
    return costs;
  }

  /// Returns the offset of the lowest cost, in steps (of equals the middle), refined by a parabola.
  static double best_offset(std::span<const float> costs) {
    std::size_t best = kRefineOffsets / 2;
    for (std::size_t i = 0; i < kRefineOffsets; ++i)
      if (costs[i] < costs[best]) best = i;
    const double whole = static_cast<int>(best) - (kRefineOffsets - 1) / 2.0;
    if (best == 0 || best == kRefineOffsets - 1) return whole;
    const auto cost = [&](std::size_t i) { return static_cast<double>(costs[i]); };
    const double before = cost(best - 1) - cost(best), after = cost(best + 1) - cost(best);
    return before + after > 1e-6 ? whole + 0.5 * (before - after) / (before + after) : whole;
  }

  const LightFieldFrame& instant_;
  const DepthEstimationOptions& options_;
  CameraDepths depths_;
  std::vector<VirtualCamera> whole_;
  std::vector<Picture> pictures_, whole_pictures_;  // of the pinholes, and of whole_
};

}  // namespace

CameraDepths estimate_camera_depths_reference(const LightFieldFrame& instant,
                                              const DepthEstimationOptions& options) {
  return Reference(instant, options).solve();
}

}  // namespace raystage::render
