// SPDX-License-Identifier: Apache-2.0
#include "planning/epipolar/instant_measurement.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "render/common/blending_field.h"
#include "render/depth/inverse_depth_map.h"
#include "render/depth/matching_image.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::planning {
namespace {

constexpr int kFirstPixels = 240, kMostPixels = 960;  // along the longer side
constexpr double kFirstStep = 0.5;                    // pixels between the nearest neighbours
constexpr double kSecondStep = 0.5;                   // pixels between the farthest neighbours
constexpr double kLeastInCommon = 0.65;               // of the picture, with the nearest neighbour
constexpr std::size_t kSecondNeighbours = 3;          // on each side
constexpr double kExtraHypotheses = 4;                // of the second pass, at each end
constexpr double kMostValues = 24e6;                  // pixels times hypotheses

/// Returns `count` of the cameras, spread over the array: each is the farthest from those before.
std::vector<int> spread_cameras(const std::vector<render::VirtualCamera>& cameras,
                                const std::vector<int>& present, std::size_t count) {
  const auto position = [&](int camera) -> const Eigen::Vector3d& {
    return cameras[static_cast<std::size_t>(camera)].pose.position;
  };
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const int camera : present) middle += position(camera) / static_cast<double>(present.size());
  std::vector<double> distance;  // to the nearest chosen one
  for (const int camera : present) distance.push_back((position(camera) - middle).norm());
  std::vector<int> chosen;
  while (chosen.size() < std::min(count, present.size())) {
    const int farthest =
        present[static_cast<std::size_t>(std::ranges::max_element(distance) - distance.begin())];
    chosen.push_back(farthest);
    for (std::size_t i = 0; i < present.size(); ++i) {
      const double apart = (position(present[i]) - position(farthest)).norm();
      distance[i] = chosen.size() == 1 ? apart : std::min(distance[i], apart);
      if (present[i] == farthest) distance[i] = -1;
    }
  }
  std::ranges::sort(chosen);
  return chosen;
}

/// Returns by how many pixels a point at 1 m moves from one camera to another.
double disparity_at_one_metre(const render::VirtualCamera& to, const render::VirtualCamera& from) {
  const auto& p = render::pixel_transfer(to, from).parallax;
  return std::hypot(p[0] - to.intrinsics.cx * p[2], p[1] - to.intrinsics.cy * p[2]);
}

}  // namespace

InstantMeasurement::InstantMeasurement(const store::Take& take,
                                       const store::FrameSelection& instant,
                                       std::size_t camera_count)
    : rig_(take.rig()), luma_(rig_.cameras.size()) {
  constexpr std::size_t kCacheBytes = std::size_t{256} << 20U;
  store::FrameCache cache(take, kCacheBytes, store::BlendSpace::kPerceptual);
  for (std::size_t i = 0; i < rig_.cameras.size(); ++i) {
    pinholes_.push_back(render::undistorted(rig_.cameras[i].model, rig_.cameras[i].pose));
    const auto camera = static_cast<int>(i);
    const int frame_of_camera = instant.frame[i];
    if (frame_of_camera >= 0 && !take.archive(camera).is_rotten(frame_of_camera)) {
      present_.push_back(camera);
    }
  }
  parallel_for(std::size_t{0}, present_.size(), [&](std::size_t i) {
    const auto camera = static_cast<std::size_t>(present_[i]);
    std::int64_t decoded = 0;
    const auto frame = cache.fetch(present_[i], instant.frame[camera], {}, decoded);
    luma_[camera] =
        render::MatchingImage(*frame, cache.scale(), rig_.cameras[camera], pinholes_[camera])
            .plane();
  });
  references_ = spread_cameras(pinholes_, present_, camera_count);
}

int InstantMeasurement::longer_side() const {
  int longest = 0;
  for (const int camera : references_) {
    const render::VirtualCamera& view = pinholes_[static_cast<std::size_t>(camera)];
    longest = std::max({longest, view.width, view.height});
  }
  return longest;
}

int InstantMeasurement::factor_for(int pixels) const {
  return std::max(1, (longer_side() + pixels - 1) / pixels);
}

double InstantMeasurement::inverse_depth_step(const EpipolarNeighbours& neighbours, int camera,
                                              int factor, std::size_t index) const {
  double most = 0;
  for (const std::vector<int>& side : neighbours) {
    if (side.empty()) continue;
    const int other = side[std::min(index, side.size() - 1)];
    most = std::max(most, disparity_at_one_metre(pinholes_[static_cast<std::size_t>(other)],
                                                 pinholes_[static_cast<std::size_t>(camera)]));
  }
  return factor / most;
}

double InstantMeasurement::inverse_depth_per_pixel() const {
  std::vector<double> all;
  for (const int camera : references_) {
    const double step =
        inverse_depth_step(epipolar_neighbours(pinholes_, present_, camera, 1), camera, 1, 0);
    if (std::isfinite(step)) all.push_back(step);
  }
  if (all.empty()) return 0;
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::ranges::nth_element(all, middle);
  return *middle;
}

std::vector<double> InstantMeasurement::first_pass(const std::function<void()>& done) const {
  const int factor = factor_for(kFirstPixels);
  const double pixels = (1 - kLeastInCommon) * longer_side() / factor;
  return search(
      factor, 1,
      [&](int, int, double per_pixel) {
        SlopeHypotheses range;
        range.farthest = -2 * kFirstStep * per_pixel;
        range.nearest = pixels * per_pixel;
        range.count = static_cast<int>(pixels / kFirstStep) + 3;
        return range;
      },
      done);
}

std::vector<double> InstantMeasurement::second_pass(schemas::DepthRange scene,
                                                    const std::function<void()>& done) const {
  int factor = factor_for(kMostPixels);  // the largest pictures for which the hypotheses fit
  while (values_of_second_pass(scene, factor) > kMostValues &&
         longer_side() / (factor + 1) >= kFirstPixels) {
    ++factor;
  }
  return search(
      factor, kSecondNeighbours,
      [&](int camera, int reduced, double per_pixel) {
        return second_hypotheses(camera, scene, reduced, per_pixel);
      },
      done);
}

double InstantMeasurement::pixels_of(int camera, int factor) const {
  const render::VirtualCamera& view = pinholes_[static_cast<std::size_t>(camera)];
  return static_cast<double>(view.width / factor) * (view.height / factor);
}

std::optional<SlopeHypotheses> InstantMeasurement::second_hypotheses(int camera,
                                                                     schemas::DepthRange scene,
                                                                     int factor,
                                                                     double per_pixel) const {
  const auto seen =
      render::inverse_depth_range_in_view(pinholes_[static_cast<std::size_t>(camera)], rig_, scene);
  if (seen.empty()) return std::nullopt;
  const double step = kSecondStep * per_pixel;
  SlopeHypotheses range;
  range.farthest = seen.farthest - kExtraHypotheses * step;
  range.nearest = seen.nearest + kExtraHypotheses * step;
  // Fewer hypotheses where they would not fit even in the smallest pictures.
  const double most = kMostValues / std::max(1.0, pixels_of(camera, factor));
  const double count = (range.nearest - range.farthest) / step;
  range.count = 2 + static_cast<int>(std::min(std::max(most, 1.0), count));
  return range;
}

double InstantMeasurement::values_of_second_pass(schemas::DepthRange scene, int factor) const {
  double most = 0;
  for (const int camera : references_) {
    const double per_pixel =
        inverse_depth_step(epipolar_neighbours(pinholes_, present_, camera, kSecondNeighbours),
                           camera, factor, kSecondNeighbours - 1);
    if (!std::isfinite(per_pixel)) continue;
    const auto seen = render::inverse_depth_range_in_view(
        pinholes_[static_cast<std::size_t>(camera)], rig_, scene);
    if (seen.empty()) continue;
    const double hypotheses =
        (seen.nearest - seen.farthest) / (kSecondStep * per_pixel) + 2 * kExtraHypotheses + 2;
    most = std::max(most, pixels_of(camera, factor) * hypotheses);
  }
  return most;
}

std::vector<double> InstantMeasurement::search(int factor, std::size_t neighbour_count,
                                               const Hypotheses& hypotheses,
                                               const std::function<void()>& done) const {
  std::vector<DetailImage> images(pinholes_.size());
  parallel_for(std::size_t{0}, present_.size(), [&](std::size_t i) {
    const auto camera = static_cast<std::size_t>(present_[i]);
    images[camera] = make_detail_image(pinholes_[camera], luma_[camera], factor);
  });
  std::vector<MeasuredMap> maps(references_.size());
  parallel_for(std::size_t{0}, references_.size(), [&](std::size_t i) {
    const int camera = references_[i];
    const EpipolarNeighbours neighbours =
        epipolar_neighbours(pinholes_, present_, camera, neighbour_count);
    const double per_pixel = inverse_depth_step(neighbours, camera, factor, neighbour_count - 1);
    const auto range = std::isfinite(per_pixel) ? hypotheses(camera, factor, per_pixel)
                                                : std::optional<SlopeHypotheses>();
    if (range) maps[i] = search_slopes(images, camera, neighbours, *range);
    done();
  });
  std::vector<double> all;
  for (const MeasuredMap& map : maps) {
    for (const MeasuredPixel& pixel : confirmed_pixels(map, maps)) {
      if (const auto depth = in_front_of_array(map.camera, pixel)) all.push_back(*depth);
    }
  }
  std::ranges::sort(all);
  return all;
}

std::optional<double> InstantMeasurement::in_front_of_array(const render::VirtualCamera& camera,
                                                            const MeasuredPixel& pixel) const {
  const Eigen::Vector3d axis = rig_.mean_viewing_direction();
  const Eigen::Vector3d at_one_metre =
      render::point_at_depth(camera, pixel.x + 0.5, pixel.y + 0.5, 1) - camera.pose.position;
  // 1 / (eye + at_one_metre . axis / q), written so that points at infinity give 0.
  const double eye = (camera.pose.position - rig_.centre()).dot(axis);
  const double ahead = at_one_metre.dot(axis) + eye * pixel.inverse_depth;
  const double inverse_depth = pixel.inverse_depth / ahead;
  if (!(ahead > 0 && std::isfinite(inverse_depth))) return std::nullopt;
  return inverse_depth;
}

EpipolarNeighbours InstantMeasurement::cameras_in_line(int camera) const {
  constexpr double kMostBeside = 0.3;  // of the distance to the nearest camera of a side
  const rig::Pose& pose = pinholes_[static_cast<std::size_t>(camera)].pose;
  EpipolarNeighbours sides = epipolar_neighbours(pinholes_, present_, camera, present_.size());
  for (std::size_t side = 0; side < sides.size(); ++side) {
    if (sides[side].empty()) continue;
    const auto offset = [&](int other) -> Eigen::Vector3d {
      return pose.world_from_camera_rotation.transpose() *
             (pinholes_[static_cast<std::size_t>(other)].pose.position - pose.position);
    };
    const Eigen::Index across = side < 2 ? 1 : 0;
    const double most = kMostBeside * offset(sides[side].front()).norm();
    std::erase_if(sides[side], [&](int other) { return std::abs(offset(other)[across]) > most; });
  }
  return sides;
}

std::vector<EpipolarImage> InstantMeasurement::epipolar_images() const {
  const Eigen::Vector3d centre = rig_.centre();
  const int middle = *std::ranges::min_element(present_, {}, [&](int camera) {
    return (pinholes_[static_cast<std::size_t>(camera)].pose.position - centre).norm();
  });
  const EpipolarNeighbours sides = cameras_in_line(middle);
  std::vector<EpipolarImage> images;
  for (const EpipolarAxis axis : {EpipolarAxis::kRow, EpipolarAxis::kColumn}) {
    const std::size_t first = axis == EpipolarAxis::kRow ? 0 : 2;
    std::vector<int> line(sides[first].rbegin(), sides[first].rend());
    line.push_back(middle);
    line.insert(line.end(), sides[first + 1].begin(), sides[first + 1].end());
    if (line.size() < 2) continue;
    images.push_back(make_epipolar_image(pinholes_, luma_, line, middle, axis));
    for (const int camera : line) {
      images.back().cameras.push_back(rig_.cameras[static_cast<std::size_t>(camera)].id);
    }
  }
  return images;
}

}  // namespace raystage::planning
