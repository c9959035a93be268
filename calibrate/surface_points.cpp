// SPDX-License-Identifier: Apache-2.0
#include "calibrate/surface_points.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numeric>
#include <optional>

#include "calibrate/corrected_picture.h"
#include "schemas/error.h"
#include "schemas/parallel.h"
#include "store/frames/photometric_correction.h"
#include "store/timeline.h"

namespace raystage {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kReach = 4;  // pixels from a patch's middle to its border
constexpr int kSide = 2 * kReach + 1;
constexpr double kStepPx = 0.75;  // from depth to depth, in the camera that sees the most of it
constexpr int kMostDepths = 400;
constexpr int kBeyond = 4;  // depths looked at nearer and farther than the scene's

/// What a camera shows, ready to be compared.
struct Shown {
  int camera = -1;
  PictureSize size;
  std::vector<std::array<float, 4>> light;  // R, G, B and the root of what the eye makes of them
  std::array<float, 3> darkest{}, brightest{};  // beyond which codes say too little

  /// Bilinear; where it lies in the picture.
  std::array<float, 4> at(const Vector2d& pixel) const {
    const auto left = static_cast<float>(pixel.x() - 0.5),
               top = static_cast<float>(pixel.y() - 0.5);
    const int x = std::clamp(static_cast<int>(left), 0, size.width - 2);
    const int y = std::clamp(static_cast<int>(top), 0, size.height - 2);
    const float u = left - static_cast<float>(x), v = top - static_cast<float>(y);
    const std::array<float, 4>* const row =
        &light[static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) +
               static_cast<std::size_t>(x)];
    const std::array<float, 4>* const next = row + size.width;
    std::array<float, 4> mean;
    for (std::size_t c = 0; c < 4; ++c) {
      mean[c] = (1 - v) * ((1 - u) * row[0][c] + u * row[1][c]) +
                v * ((1 - u) * next[0][c] + u * next[1][c]);
    }
    return mean;
  }
};

Shown shown_by(const Take& take, const Rig& rig, int camera, int frame) {
  const Rig::Camera& of = rig.cameras[static_cast<std::size_t>(camera)];
  PhotometricResponse response;
  response.curve = of.photometric.curve;
  response.dark_pixels = of.photometric.dark_pixels;
  const CodeScale scale{BlendSpace::kLinear, 1};
  const CorrectedPicture picture = corrected_picture(take, camera, frame, response, scale);
  if (picture.size.width != of.model.width() || picture.size.height != of.model.height()) {
    throw Error::bad_input("camera \"" + of.id + "\" has frames of another size than in the rig",
                           take.folder().string(), "Give the rig of the same cameras");
  }
  Shown shown{camera, picture.size, {}, {}, {}};
  constexpr float kScale = 1.0F / 65535;
  shown.light.resize(picture.rgba.size() / 4);
  for (std::size_t i = 0; i < shown.light.size(); ++i) {
    const float r = kScale * picture.rgba[4 * i], g = kScale * picture.rgba[4 * i + 1],
                b = kScale * picture.rgba[4 * i + 2];
    shown.light[i] = {r, g, b, std::sqrt(0.2126F * r + 0.7152F * g + 0.0722F * b)};
  }
  constexpr std::uint8_t kBlack = 2, kFull = 250;
  const auto level_of = [&](std::uint8_t code) {
    const auto level = PhotometricCorrection::reference(response, picture.size, take.document(),
                                                        scale, 0, 0, {code, code, code});
    return std::array{kScale * level[0], kScale * level[1], kScale * level[2]};
  };
  shown.darkest = level_of(kBlack);
  shown.brightest = level_of(kFull);
  return shown;
}

/// A patch's pixels in one picture: its corners, and the rest evenly between them.
using Corners = std::array<Vector2d, 4>;  // by rows

struct Patch {
  std::array<float, kSide * kSide> pattern;  // mean 0, squares sum up to 1
  float contrast = 0;
  Rgb mean{};
  bool is_exposed = true;
};

std::optional<Patch> patch_at(const Shown& shown, const Corners& corners) {
  for (const Vector2d& corner : corners) {
    if (!(corner.x() >= 0.5 && corner.y() >= 0.5 && corner.x() <= shown.size.width - 0.5 &&
          corner.y() <= shown.size.height - 0.5)) {
      return std::nullopt;
    }
  }
  Patch patch;
  float sum = 0;
  std::size_t count = 0;
  for (int j = 0; j < kSide; ++j) {
    const double v = j / (kSide - 1.0);
    const Vector2d left = (1 - v) * corners[0] + v * corners[2];
    const Vector2d step = ((1 - v) * corners[1] + v * corners[3] - left) / (kSide - 1.0);
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

double likeness(const Patch& one, const Patch& other) {
  return std::inner_product(one.pattern.begin(), one.pattern.end(), other.pattern.begin(), 0.0F);
}

/// Rays through the middle and the corners of a patch of the base camera.
struct PatchRays {
  Vector3d origin;
  std::array<Vector3d, 5> direction;  // in the world; the middle last
};

/// Where surfaces across the array's viewing direction lie.
class Depths {
 public:
  Depths(const Rig& rig, const DepthRange& range)
      : centre_(rig.centre()),
        forward_(rig.mean_viewing_direction()),
        farthest_(1 / range.far),
        nearest_(1 / range.near) {}

  /// 1 / metres in front of the array, `share` of the way from far to near.
  double inverse(double share) const {
    constexpr double kFar = 1e-7;
    return std::max(kFar, std::lerp(farthest_, nearest_, share));
  }
  /// Where a ray comes to a depth; nowhere where it goes another way.
  std::optional<Vector3d> point(const Vector3d& origin, const Vector3d& direction,
                                double inverse_depth) const {
    const double along =
        (1 / inverse_depth - forward_.dot(origin - centre_)) / forward_.dot(direction);
    if (!(along > 0) || !std::isfinite(along)) return std::nullopt;
    return origin + direction * along;
  }

 private:
  Vector3d centre_, forward_;
  double farthest_, nearest_;
};

std::optional<PatchRays> rays_of(const Rig::Camera& camera, const Vector2d& middle) {
  PatchRays rays{camera.pose.position, {}};
  constexpr std::array<std::array<int, 2>, 5> kPlaces{{{-1, -1}, {1, -1}, {-1, 1}, {1, 1}, {0, 0}}};
  for (std::size_t i = 0; i < kPlaces.size(); ++i) {
    const Vector2d off(kReach * kPlaces[i][0], kReach * kPlaces[i][1]);
    const auto ray = camera.model.unproject(middle + off);
    if (!ray) return std::nullopt;
    rays.direction[i] = camera.pose.world_from_camera_rotation * *ray;
  }
  return rays;
}

/// The patch's corners and its middle in another camera.
std::optional<std::array<Vector2d, 5>> projected(const PatchRays& rays, const Depths& depths,
                                                 double inverse_depth, const Rig::Camera& camera) {
  std::array<Vector2d, 5> pixels;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto x = depths.point(rays.origin, rays.direction[i], inverse_depth);
    if (!x) return std::nullopt;
    const auto pixel = camera.model.project(camera.pose.camera_from_world(*x));
    if (!pixel) return std::nullopt;
    pixels[i] = *pixel;
  }
  return pixels;
}

Corners corners_of(const std::array<Vector2d, 5>& pixels) {
  return {pixels[0], pixels[1], pixels[2], pixels[3]};
}

/// Looks for the patches of one camera in the cameras around it.
class PatchSearch {
 public:
  PatchSearch(const Rig& rig, const SurfaceSettings& settings, const Depths& depths, Shown base,
              std::vector<Shown> others)
      : rig_(rig),
        settings_(settings),
        depths_(depths),
        base_(std::move(base)),
        others_(std::move(others)) {
    double most = 0;
    for (const Shown& other : others_) {
      for (const auto& [u, v] :
           {std::pair{0.5, 0.5}, {0.1, 0.1}, {0.9, 0.1}, {0.1, 0.9}, {0.9, 0.9}}) {
        const auto rays = rays_of(camera(base_), {u * base_.size.width, v * base_.size.height});
        if (!rays) continue;
        const auto far = projected(*rays, depths_, depths_.inverse(0), camera(other));
        const auto near = projected(*rays, depths_, depths_.inverse(1), camera(other));
        if (far && near) most = std::max(most, ((*near)[4] - (*far)[4]).norm());
      }
    }
    steps_ = std::clamp(static_cast<int>(std::ceil(most / kStepPx)), 2, kMostDepths);
  }

  /// Some beyond either end, so that what lies there is not taken for what lies between them.
  std::optional<SurfacePoint> find(const Vector2d& middle) const {
    const Vector2d off(kReach, kReach), across(kReach, -kReach);
    const auto patch =
        patch_at(base_, {middle - off, middle + across, middle - across, middle + off});
    if (!patch || !patch->is_exposed || patch->contrast < settings_.least_contrast) {
      return std::nullopt;
    }
    const auto rays = rays_of(camera(base_), middle);
    if (!rays) return std::nullopt;
    std::vector<double> score;
    for (int step = -kBeyond; step <= steps_ + kBeyond; ++step) {
      score.push_back(agreement(*patch, *rays, step));
    }
    const auto best = static_cast<int>(std::ranges::max_element(score) - score.begin());
    if (best < kBeyond || best > steps_ + kBeyond) return std::nullopt;
    const auto at = [&](int i) { return score[static_cast<std::size_t>(i)]; };
    constexpr int kSameHill = 3;
    for (int i = 0; i < static_cast<int>(score.size()); ++i) {
      const bool is_apart = std::abs(i - best) > kSameHill;
      if (is_apart && at(i) > at(best) - settings_.least_lead) return std::nullopt;
    }
    const double bend = at(best - 1) - 2 * at(best) + at(best + 1);
    const double shift = bend < 0 ? (at(best - 1) - at(best + 1)) / (2 * bend) : 0;
    return point_at(*patch, *rays, middle, best - kBeyond + std::clamp(shift, -0.5, 0.5));
  }

 private:
  const Rig::Camera& camera(const Shown& shown) const {
    return rig_.cameras[static_cast<std::size_t>(shown.camera)];
  }
  double inverse_depth(double step) const { return depths_.inverse(step / steps_); }

  std::optional<Patch> patch_in(const Shown& other, const PatchRays& rays, double step,
                                Vector2d& middle) const {
    const auto pixels = projected(rays, depths_, inverse_depth(step), camera(other));
    if (!pixels) return std::nullopt;
    middle = (*pixels)[4];
    return patch_at(other, corners_of(*pixels));
  }

  /// Mean likeness of the better half of the cameras: the others may be kept from seeing it.
  double agreement(const Patch& patch, const PatchRays& rays, double step) const {
    std::vector<double> alike;
    Vector2d middle;
    for (const Shown& other : others_) {
      const auto found = patch_in(other, rays, step, middle);
      if (found) alike.push_back(likeness(patch, *found));
    }
    if (alike.empty()) return -1;
    std::ranges::sort(alike, std::greater<>());
    const std::size_t half = (alike.size() + 1) / 2;
    return std::accumulate(alike.begin(), alike.begin() + static_cast<std::ptrdiff_t>(half), 0.0) /
           static_cast<double>(half);
  }

  std::optional<SurfacePoint> point_at(const Patch& patch, const PatchRays& rays,
                                       const Vector2d& middle, double step) const {
    SurfacePoint point;
    point.sights.push_back({base_.camera, middle.x(), middle.y(), patch.mean});
    std::size_t visible = 0;
    for (const Shown& other : others_) {
      Vector2d there;
      const auto found = patch_in(other, rays, step, there);
      if (!found) continue;
      ++visible;
      if (!found->is_exposed || likeness(patch, *found) < settings_.least_likeness) continue;
      point.sights.push_back({other.camera, there.x(), there.y(), found->mean});
    }
    // One camera alone agrees by chance more easily than two do.
    const std::size_t least = 1 + std::clamp<std::size_t>(visible, 1, 2);
    if (point.sights.size() < least) return std::nullopt;
    return point;
  }

  const Rig& rig_;
  const SurfaceSettings& settings_;
  const Depths& depths_;
  Shown base_;
  std::vector<Shown> others_;
  int steps_ = 2;
};

std::vector<int> nearest_cameras(const Rig& rig, const FrameSelection& frames, int to, int count) {
  std::vector<int> cameras;
  for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
    if (c != to && frames.frame[static_cast<std::size_t>(c)] >= 0) cameras.push_back(c);
  }
  const auto distance = [&](int c) {
    return (rig.cameras[static_cast<std::size_t>(c)].pose.position -
            rig.cameras[static_cast<std::size_t>(to)].pose.position)
        .norm();
  };
  std::ranges::stable_sort(cameras, {}, distance);
  if (cameras.size() > static_cast<std::size_t>(count)) {
    cameras.resize(static_cast<std::size_t>(count));
  }
  return cameras;
}

std::vector<FrameSelection> instants_of(const Take& take, int count) {
  const auto known = read_timeline_if_any(take);
  const Timeline timeline = known ? *known : build_timeline(take, 0, 0);
  std::vector<FrameSelection> instants;
  const auto ticks = static_cast<int>(timeline.ticks.size());
  const int used = std::min(count, ticks);
  for (int i = 0; i < used; ++i) {
    const auto tick = static_cast<std::size_t>((2 * i + 1) * ticks / (2 * used));
    instants.push_back(timeline.ticks[tick]);
  }
  return instants;
}

}  // namespace

std::vector<SurfacePoint> surface_points(const Take& take, const Rig& rig,
                                         const SurfaceSettings& settings,
                                         const std::function<void(double)>& progress,
                                         const std::stop_token& stop) {
  const std::vector<FrameSelection> instants = instants_of(take, settings.instants);
  const Depths depths(rig, settings.depths);
  const std::size_t cameras = rig.cameras.size();
  std::vector<std::vector<SurfacePoint>> found(instants.size() * cameras);
  std::atomic<std::size_t> done = 0;
  parallel_for(std::size_t{0}, found.size(), [&](std::size_t task) {
    if (stop.stop_requested()) {
      throw Error::failed("the search for surfaces was stopped", take.folder().string(),
                          "Start it again");
    }
    const FrameSelection& instant = instants[task / cameras];
    const auto base = static_cast<int>(task % cameras);
    const auto shown = [&](int camera) {
      return shown_by(take, rig, camera, instant.frame[static_cast<std::size_t>(camera)]);
    };
    if (instant.frame[static_cast<std::size_t>(base)] >= 0) {
      std::vector<Shown> others;
      for (const int camera : nearest_cameras(rig, instant, base, settings.neighbours)) {
        others.push_back(shown(camera));
      }
      const PatchSearch search(rig, settings, depths, shown(base), std::move(others));
      const CameraModel& model = rig.cameras[static_cast<std::size_t>(base)].model;
      for (int j = 0; j < settings.rows; ++j) {
        for (int i = 0; i < settings.columns; ++i) {
          auto point = search.find({std::floor((i + 0.5) * model.width() / settings.columns) + 0.5,
                                    std::floor((j + 0.5) * model.height() / settings.rows) + 0.5});
          if (point) found[task].push_back(std::move(*point));
        }
      }
    }
    progress(static_cast<double>(++done) / static_cast<double>(found.size()));
  });
  std::vector<SurfacePoint> all, points;
  for (auto& some : found) std::ranges::move(some, std::back_inserter(all));
  const auto most = static_cast<std::size_t>(settings.most_points);
  if (all.size() <= most) return all;
  for (std::size_t i = 0; i < most; ++i) points.push_back(std::move(all[i * all.size() / most]));
  return points;
}

}  // namespace raystage
