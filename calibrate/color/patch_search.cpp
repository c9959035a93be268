// SPDX-License-Identifier: Apache-2.0
// Finds the depth of a small patch by a plane sweep. At each step of inverse depth the patch is
// projected into the neighbouring cameras (corners exactly, pixels bilinear between). It is
// compared by normalised cross-correlation of the square root of luminance. The score is the mean
// of the better half of the cameras, because the others may be occluded; a parabola refines the
// best step. Output: the patch with the observations above `min_ncc`. Cost per patch: steps times
// cameras times 81 pixels.
#include "calibrate/color/patch_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "store/processing/frames/corrected_frame.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kReach = 4;  // pixels from a patch's centre to its border
constexpr int kSide = 2 * kReach + 1;
constexpr int kSameHill = 3;  // steps around the best depth that belong to its peak
constexpr int kBeyond = 4;    // additional steps on both sides of the depth range
constexpr int kMaxSteps = 400;

/// The corners of a patch by rows, then its centre, in one picture.
using Pixels = std::array<Vector2d, 5>;

/// Returns the offsets of a patch's corners and centre from its centre.
std::array<Vector2d, 5> patch_offsets() {
  return {Vector2d(-kReach, -kReach), Vector2d(kReach, -kReach), Vector2d(-kReach, kReach),
          Vector2d(kReach, kReach), Vector2d(0, 0)};
}

Vector3d ray_in_world(const rig::Rig::Camera& camera, const Vector3d& in_camera) {
  return camera.pose.world_from_camera_rotation * in_camera;
}

std::optional<Vector2d> projected(const rig::Rig::Camera& camera,
                                  const std::optional<Vector3d>& x) {
  if (!x) return std::nullopt;
  return camera.model.project(camera.pose.camera_from_world(*x));
}

}  // namespace

std::array<float, 4> PatchSearchImage::at(const Vector2d& pixel) const {
  const auto left = static_cast<float>(pixel.x() - 0.5), top = static_cast<float>(pixel.y() - 0.5);
  const int x = std::clamp(static_cast<int>(left), 0, light.width - 2);
  const int y = std::clamp(static_cast<int>(top), 0, light.height - 2);
  const float u = left - static_cast<float>(x), v = top - static_cast<float>(y);
  const std::array<float, 4>*const row = &light.at(x, y), *const next = &light.at(x, y + 1);
  std::array<float, 4> mean;
  for (std::size_t c = 0; c < 4; ++c) {
    mean[c] = (1 - v) * ((1 - u) * row[0][c] + u * row[1][c]) +
              v * ((1 - u) * next[0][c] + u * next[1][c]);
  }
  return mean;
}

PatchSearchImage load_patch_search_image(const store::Take& take, const rig::Rig& rig, int camera,
                                         int frame, const store::LevelTable& levels) {
  const rig::Rig::Camera& of = rig.cameras[camera];
  const schemas::PhotometricResponse response = store::curve_and_hot_pixels_only(of.photometric);
  const store::CodeScale scale{store::BlendSpace::kLinear, 1};
  const rig::PictureSize size{of.model.width(), of.model.height()};
  const store::CorrectedFrame picture =
      store::decode_corrected_frame(take, camera, frame, size, response, scale, levels);
  PatchSearchImage shown{camera, {size.width, size.height}, {}, {}};
  constexpr float kScale = 1.0F / 65535;
  for (std::size_t i = 0; i < shown.light.values.size(); ++i) {
    const float r = kScale * picture.values[4 * i], g = kScale * picture.values[4 * i + 1],
                b = kScale * picture.values[4 * i + 2];
    shown.light.values[i] = {r, g, b, std::sqrt(0.2126F * r + 0.7152F * g + 0.0722F * b)};
  }
  const auto black = store::levels_from_code(take, response, scale, store::kMinUnclippedCode);
  const auto full = store::levels_from_code(take, response, scale, store::kMaxUnclippedCode);
  for (std::size_t c = 0; c < 3; ++c) {
    shown.darkest[c] = kScale * black[c];
    shown.brightest[c] = kScale * full[c];
  }
  return shown;
}

InverseDepthSteps::InverseDepthSteps(const rig::Rig& rig, const schemas::DepthRange& range,
                                     int base, const std::vector<int>& others)
    : centre_(rig.centre()), forward_(rig.mean_viewing_direction()) {
  constexpr double kNearlyOne = 0.01;  // smallest range of inverse depths, relative
  farthest_ = 1 / range.far;
  const double width = 1 / range.near - farthest_;
  const double looked_at = std::max(width, kNearlyOne / range.near);
  const rig::Rig::Camera& from = rig.cameras[base];
  double most = 0;  // largest shift between the two depths, pixels
  for (const auto& [u, v] : {std::pair{0.5, 0.5}, {0.1, 0.1}, {0.9, 0.1}, {0.1, 0.9}, {0.9, 0.9}}) {
    const auto ray = from.model.unproject({u * from.model.width(), v * from.model.height()});
    if (!ray) continue;
    const Vector3d direction = ray_in_world(from, *ray);
    for (const int other : others) {
      const rig::Rig::Camera& to = rig.cameras[other];
      const auto far = projected(to, point_at(from.pose.position, direction, farthest_));
      const auto near =
          projected(to, point_at(from.pose.position, direction, farthest_ + looked_at));
      if (far && near) most = std::max(most, (*near - *far).norm());
    }
  }
  count_ = 1;
  if (!(most > 0)) return;  // no parallax: depth does not matter
  const double by_pixels = looked_at * kStepPx / most;
  const int within = std::clamp(static_cast<int>(std::ceil(width / by_pixels)), 1, kMaxSteps);
  step_ = within > 1 ? width / within : by_pixels;
  // Inverse depth ends at 0 (infinity).
  const int beyond = std::min(kBeyond, static_cast<int>(farthest_ / step_));
  farthest_ -= beyond * step_;
  first_ = beyond;
  last_ = beyond + within;
  count_ = last_ + kBeyond + 1;
}

std::optional<Vector3d> InverseDepthSteps::point(const Vector3d& origin, const Vector3d& direction,
                                                 double step) const {
  return point_at(origin, direction, farthest_ + step * step_);
}

std::optional<Vector3d> InverseDepthSteps::point_at(const Vector3d& origin,
                                                    const Vector3d& direction,
                                                    double inverse_depth) const {
  constexpr double kFar = 1e-9;  // 1 / metres: infinity for every camera
  const double depth = 1 / std::max(kFar, inverse_depth);
  const double along = (depth - forward_.dot(origin - centre_)) / forward_.dot(direction);
  if (!(along > 0) || !std::isfinite(along)) return std::nullopt;
  return origin + direction * along;
}

struct PatchSearch::Patch {
  std::array<float, kSide * kSide> pattern;  // mean 0, norm 1
  float contrast = 0;
  schemas::Rgb mean{};
  bool is_exposed = true;

  /// Samples the patch in a picture, bilinear between its corners.
  static std::optional<Patch> at(const PatchSearchImage& shown, const Pixels& pixels);

  double likeness(const Patch& other) const {
    return std::inner_product(pattern.begin(), pattern.end(), other.pattern.begin(), 0.0F);
  }
};

std::optional<PatchSearch::Patch> PatchSearch::Patch::at(const PatchSearchImage& shown,
                                                         const Pixels& pixels) {
  for (const Vector2d& pixel : pixels) {
    if (!(pixel.x() >= 0.5 && pixel.y() >= 0.5 && pixel.x() <= shown.light.width - 0.5 &&
          pixel.y() <= shown.light.height - 0.5)) {
      return std::nullopt;
    }
  }
  Patch patch;
  float sum = 0;
  std::size_t count = 0;
  for (int j = 0; j < kSide; ++j) {
    const double v = j / (kSide - 1.0);
    const Vector2d left = (1 - v) * pixels[0] + v * pixels[2];
    const Vector2d step = ((1 - v) * pixels[1] + v * pixels[3] - left) / (kSide - 1.0);
    for (int i = 0; i < kSide; ++i) {
      const std::array<float, 4> light = shown.at(left + i * step);
      for (std::size_t c = 0; c < 3; ++c) {
        patch.mean[c] += light[c] / (kSide * kSide);
        patch.is_exposed = patch.is_exposed && light[c] < shown.brightest[c];
      }
      patch.pattern[count++] = light[3];
      sum += light[3];
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    patch.is_exposed = patch.is_exposed && patch.mean[c] > shown.darkest[c];
  }
  float squares = 0;
  for (float& value : patch.pattern) {
    value -= sum / (kSide * kSide);
    squares += value * value;
  }
  patch.contrast = std::sqrt(squares / (kSide * kSide));
  const float norm = 1 / std::sqrt(std::max(squares, 1e-12F));
  for (float& value : patch.pattern) value *= norm;
  return patch;
}

/// Rays through the corners and the centre of a patch of the base camera.
struct PatchSearch::Rays {
  Vector3d origin;
  std::array<Vector3d, 5> direction;  // in the world

  static std::optional<Rays> of(const rig::Rig::Camera& camera, const Pixels& pixels) {
    Rays rays{camera.pose.position, {}};
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const auto ray = camera.model.unproject(pixels[i]);
      if (!ray) return std::nullopt;
      rays.direction[i] = ray_in_world(camera, *ray);
    }
    return rays;
  }
};

namespace {

std::vector<int> cameras_of(const std::vector<PatchSearchImage>& pictures) {
  std::vector<int> cameras;
  for (const PatchSearchImage& picture : pictures) cameras.push_back(picture.camera);
  return cameras;
}

}  // namespace

PatchSearch::PatchSearch(const rig::Rig& rig, const PatchSearchOptions& options,
                         const PatchSearchImage& base, const std::vector<PatchSearchImage>& others)
    : rig_(rig),
      options_(options),
      base_(base),
      others_(others),
      steps_(rig, options.depths, base.camera, cameras_of(others)) {}

std::optional<ScenePatch> PatchSearch::find(const Vector2d& middle) const {
  Pixels pixels = patch_offsets();
  for (Vector2d& pixel : pixels) pixel += middle;
  const auto patch = Patch::at(base_, pixels);
  if (!patch || !patch->is_exposed || patch->contrast < options_.min_contrast) return std::nullopt;
  const auto rays = Rays::of(camera(base_), pixels);
  if (!rays) return std::nullopt;
  const auto step = best_step(*patch, *rays);
  if (!step) return std::nullopt;
  return point_at(*patch, *rays, middle, *step);
}

/// Returns the best step; none if it is outside the scene's depths or another peak is as good.
std::optional<double> PatchSearch::best_step(const Patch& patch, const Rays& rays) const {
  std::vector<double> score;
  for (int step = 0; step < steps_.count(); ++step) score.push_back(depth_score(patch, rays, step));
  const auto at = [&](int i) { return score[i]; };
  const auto best = static_cast<int>(std::ranges::max_element(score) - score.begin());
  if (best < steps_.first() || best > steps_.last()) return std::nullopt;
  for (int i = 0; i < steps_.count(); ++i) {
    const bool is_apart = std::abs(i - best) > kSameHill;
    if (is_apart && at(i) > at(best) - options_.min_ncc_margin) return std::nullopt;
  }
  if (best == 0) return 0;  // infinity
  const double bend = at(best - 1) - 2 * at(best) + at(best + 1);
  const double shift = bend < 0 ? (at(best - 1) - at(best + 1)) / (2 * bend) : 0;
  return best + std::clamp(shift, -0.5, 0.5);
}

std::optional<PatchSearch::Patch> PatchSearch::match_patch(const PatchSearchImage& other,
                                                           const Rays& rays, double step,
                                                           Vector2d& middle) const {
  Pixels pixels;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto pixel = projected(camera(other), steps_.point(rays.origin, rays.direction[i], step));
    if (!pixel) return std::nullopt;
    pixels[i] = *pixel;
  }
  middle = pixels.back();
  return Patch::at(other, pixels);
}

/// Returns the mean NCC of the better half of the cameras: the others may be occluded.
double PatchSearch::depth_score(const Patch& patch, const Rays& rays, double step) const {
  std::vector<double> alike;
  Vector2d middle;
  for (const PatchSearchImage& other : others_) {
    const auto found = match_patch(other, rays, step, middle);
    if (found) alike.push_back(patch.likeness(*found));
  }
  if (alike.empty()) return -1;
  std::ranges::sort(alike, std::greater<>());
  const std::size_t half = (alike.size() + 1) / 2;
  return std::accumulate(alike.begin(), alike.begin() + half, 0.0) / static_cast<double>(half);
}

std::optional<ScenePatch> PatchSearch::point_at(const Patch& patch, const Rays& rays,
                                                const Vector2d& middle, double step) const {
  ScenePatch point;
  point.observations.push_back({base_.camera, middle.x(), middle.y(), patch.mean});
  std::size_t visible = 0;
  for (const PatchSearchImage& other : others_) {
    Vector2d there;
    const auto found = match_patch(other, rays, step, there);
    if (!found) continue;
    ++visible;
    if (!found->is_exposed || patch.likeness(*found) < options_.min_ncc) continue;
    point.observations.push_back({other.camera, there.x(), there.y(), found->mean});
  }
  // A single camera matches by chance more easily than two.
  const std::size_t least = 1 + std::clamp<std::size_t>(visible, 1, 2);
  if (point.observations.size() < least) return std::nullopt;
  return point;
}

}  // namespace raystage::calibrate
