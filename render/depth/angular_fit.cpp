// SPDX-License-Identifier: Apache-2.0
// Where a surface reflects, shines or is transparent, the light of a point depends on where it is
// seen from. The mean of the cameras blurs it. A quadratic polynomial over the positions of the
// cameras follows it, but has more noise (fit_angular()). A view therefore uses the fit where it
// differs from the mean by more than noise explains: by the ratio of both, as in an F-test, of the
// pixels of some rows, summed over 3 x 3 cells of 16 x 16 pixels. Edges of depth are left out: what
// differs there is hidden from some of the cameras. Input: samples of method "depth" at the view's
// depths. Cost: the rows that are measured, and sampling the cells that are fitted a second time.
#include "render/depth/angular_fit.h"

#include <algorithm>
#include <cmath>

#include "render/depth/surface_pairs.h"

namespace raystage::render::depth {
namespace {

/// Root mean square differences, in units of noise, from which on the fit counts, and counts fully.
constexpr double kLeastRatio = 1.75, kFullRatio = 2.15;
/// Noise that is always assumed, codes of 255: rounding, and differences too small to see.
constexpr double kLeastNoise = 0.3;

int angular_cells(int pixels) {
  return (pixels + AngularStrengths::kCell - 1) / AngularStrengths::kCell;
}

}  // namespace

AngularStrengths::AngularStrengths(int width, int height)
    : columns_(angular_cells(width)),
      rows_(angular_cells(height)),
      sums_(static_cast<std::size_t>(columns_) * rows_),
      strengths_(sums_.size(), 0.0F) {
  static_assert(BlendingField::kTile % kCell == 0 && kCell % kRowStep == 0);
}

void AngularStrengths::measure(int x, int y, double difference, double noise) {
  Sums& sums = sums_[static_cast<std::size_t>(y / kCell) * columns_ + x / kCell];
  sums.difference += difference;
  sums.noise += noise + kLeastNoise * kLeastNoise;
}

void AngularStrengths::decide() {
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      Sums around;
      for (int y = std::max(0, row - 1); y <= std::min(rows_ - 1, row + 1); ++y) {
        for (int x = std::max(0, column - 1); x <= std::min(columns_ - 1, column + 1); ++x) {
          const Sums& sums = sums_[static_cast<std::size_t>(y) * columns_ + x];
          const double weight = (x == column ? 1 : 0.5) * (y == row ? 1 : 0.5);
          around.difference += weight * sums.difference;
          around.noise += weight * sums.noise;
        }
      }
      const double ratio = around.noise > 0 ? std::sqrt(around.difference / around.noise) : 0;
      strengths_[static_cast<std::size_t>(row) * columns_ + column] = static_cast<float>(
          std::clamp((ratio - kLeastRatio) / (kFullRatio - kLeastRatio), 0.0, 1.0));
    }
  }
}

float AngularStrengths::at(int x, int y) const {
  const auto place = [](int pixel, int cells) {
    return std::clamp((static_cast<float>(pixel) + 0.5F) / kCell - 0.5F, 0.0F,
                      static_cast<float>(cells - 1));
  };
  const float u = place(x, columns_), v = place(y, rows_);
  const int left = static_cast<int>(u), top = static_cast<int>(v);
  const auto strength = [&](int column, int row) {
    return strengths_[static_cast<std::size_t>(std::min(row, rows_ - 1)) * columns_ +
                      std::min(column, columns_ - 1)];
  };
  const auto along = [&](int row) {
    return std::lerp(strength(left, row), strength(left + 1, row), u - static_cast<float>(left));
  };
  return std::lerp(along(top), along(top + 1), v - static_cast<float>(top));
}

bool AngularStrengths::reaches(const BlendingField::Tile& tile) const {
  for (int row = std::max(0, tile.top / kCell - 1); row <= std::min(rows_ - 1, tile.bottom / kCell);
       ++row) {
    for (int column = std::max(0, tile.left / kCell - 1);
         column <= std::min(columns_ - 1, tile.right / kCell); ++column) {
      if (strengths_[static_cast<std::size_t>(row) * columns_ + column] > 0) return true;
    }
  }
  return false;
}

bool AngularStrengths::may_reach(const BlendingField::Tile& tile) const {
  constexpr double kMargin = 0.8;  // neighbouring cells raise and lower the ratio
  for (int row = tile.top / kCell; row * kCell < tile.bottom; ++row) {
    for (int column = tile.left / kCell; column * kCell < tile.right; ++column) {
      const Sums& sums = sums_[static_cast<std::size_t>(row) * columns_ + column];
      if (sums.difference > std::pow(kMargin * kLeastRatio, 2) * sums.noise) return true;
    }
  }
  return false;
}

std::vector<AngularPosition> angular_positions(const ViewRequest& request,
                                               const DepthViewPlan& plan,
                                               const BlendingField::Tile& tile) {
  const rig::Pose& pose = request.view.pose;
  const schemas::Intrinsics& k = request.view.intrinsics;
  const double depth = (plan.range.farthest + plan.range.nearest) / 2;
  const double slope = ((tile.left + tile.right) / 2.0 - k.cx) / k.fx;
  const double slope_up = (k.cy - (tile.top + tile.bottom) / 2.0) / k.fy;
  std::vector<AngularPosition> positions;
  double squares = 0;
  for (const BlendingField::TileCamera& camera : tile.cameras) {
    const Eigen::Vector3d to =
        pose.world_from_camera_rotation.transpose() *
        (request.instant.rig->cameras[camera.camera].pose.position - pose.position);
    const double ahead = -to.z();
    const double distance = std::max(double{kMinAngularDistance}, 1 - ahead * depth);
    squares += (std::pow(to.x() - slope * ahead, 2) + std::pow(to.y() - slope_up * ahead, 2)) /
               (distance * distance);
    positions.push_back({to.x(), to.y(), ahead, ahead});
  }
  // The unit: the root mean square distance of the cameras from the view's ray.
  const double unit = std::sqrt(squares / static_cast<double>(positions.size())) + 1e-12;
  for (AngularPosition& position : positions) {
    position.right /= unit;
    position.up /= unit;
    position.ahead /= unit;
  }
  return positions;
}

float angular_edge_separation(const DepthViewPlan& plan) {
  return kOcclusionRamp * visibility_tolerance(plan);
}

AngularFit::AngularFit(const ViewRequest& request, const DepthViewPlan& plan)
    : request_(request),
      plan_(plan),
      separation_(angular_edge_separation(plan)),
      strengths_(request.view.width, request.view.height) {}

bool AngularFit::may_fit(const Tile& tile) const {
  return !request_.instant.cache->has_matte() &&
         static_cast<float>(tile.cameras.size()) >= kMinAngularCameras;
}

std::vector<AngularOffset> AngularFit::offsets(const Tile& tile) const {
  std::vector<AngularOffset> offsets;
  for (const AngularPosition& p : angular_positions(request_, plan_, tile)) {
    offsets.push_back({static_cast<float>(p.right), static_cast<float>(p.up),
                       static_cast<float>(p.ahead), static_cast<float>(p.ahead_m)});
  }
  return offsets;
}

void AngularFit::solve(const Tile& tile, const Row& row, AngularFitResult& result) const {
  const schemas::Intrinsics& k = request_.view.intrinsics;
  const float* depths = &plan_.view_depths.at(tile.left, row.y);
  fit_angular({row.samples,
               row.weights,
               row.visible,
               row.offsets,
               static_cast<float>((tile.left + 0.5 - k.cx) / k.fx),
               static_cast<float>(1 / k.fx),
               static_cast<float>((k.cy - row.y - 0.5) / k.fy),
               {depths, static_cast<std::size_t>(tile.right - tile.left)}},
              result);
}

void AngularFit::measure(const Tile& tile, int y, const AngularFitResult& result) {
  const SurfaceRun edges =
      surfaces_of_run(plan_.view_depths, tile.left, y, tile.right - tile.left, separation_);
  for (int x = tile.left; x < tile.right; ++x) {
    const auto i = static_cast<std::size_t>(x - tile.left);
    if (edges.is_pair[i] || !(result.rgba[4 * i + 3] > 0)) continue;
    strengths_.measure(x, y, double{result.difference[i]}, double{result.noise[i]});
  }
}

bool AngularFit::strengths_of_row(const Tile& tile, int y, std::span<float> strengths) const {
  const SurfaceRun edges =
      surfaces_of_run(plan_.view_depths, tile.left, y, tile.right - tile.left, separation_);
  bool is_any = false;
  for (int x = tile.left; x < tile.right; ++x) {
    const auto i = static_cast<std::size_t>(x - tile.left);
    strengths[i] = edges.is_pair[i] ? 0 : strengths_.at(x, y);
    is_any = is_any || strengths[i] > 0;
  }
  return is_any;
}

void weigh_angular_fit(std::span<const float> rgba, std::span<const float> strengths,
                       std::span<float> sums) {
  for (std::size_t i = 0; i < strengths.size(); ++i) {
    const float strength = strengths[i] * rgba[4 * i + 3];
    for (std::size_t c = 0; c < 3; ++c)
      sums[4 * i + c] = strength * std::max(0.0F, rgba[4 * i + c]);
    sums[4 * i + 3] = strength * 65535;
  }
}

void mix_angular_fit(const store::FrameCache& cache, std::span<const float> sums,
                     std::span<float> rgba) {
  std::array<float, std::size_t{4} * BlendingField::kTile> light;
  for (std::size_t begin = 0; begin < sums.size(); begin += light.size()) {
    const auto part = sums.subspan(begin, std::min(light.size(), sums.size() - begin));
    if (!std::ranges::any_of(part, [](float sum) { return sum > 0; })) continue;
    for (std::size_t i = 0; i < part.size(); i += 4) {
      const float per_strength = part[i + 3] > 0 ? 65535 / part[i + 3] : 0;
      for (std::size_t c = 0; c < 3; ++c) light[i + c] = part[i + c] * per_strength;
      light[i + 3] = 65535;
    }
    const std::span<float> finished(light.data(), part.size());
    finish_samples(finished, cache.blend_space(), static_cast<float>(cache.full_scale()), finished);
    for (std::size_t i = 0; i < part.size(); i += 4) {
      const float strength = part[i + 3] / 65535, alpha = rgba[begin + i + 3];
      for (std::size_t c = 0; c < 3; ++c) {
        float& value = rgba[begin + i + c];
        value += strength * (light[i + c] * alpha - value);
      }
    }
  }
}

}  // namespace raystage::render::depth
