// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include "render/planar/focal_plane.h"
#include "render/sampling/source_view.h"
#include "render/view/plane_projection.h"
#include "render/view/ray_cells.h"
#include "schemas/error.h"
#include "schemas/parallel.h"
#include "schemas/transfer_function.h"

namespace raystage {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

struct Sample {
  std::array<double, 3> rgb{};  ///< on the scale of the blend space, full scale 1
  double seen = 0;              ///< 1 within the frame, falling to 0 at its border
};

/// Which pixels of each camera's frame are read: 1 byte a pixel, empty where nobody asked.
using ReadPixels = std::vector<std::vector<std::uint8_t>>;

/// Bilinear look-up; pixel centres at +0.5. `read` may be empty. Rows that are read at the same
/// time may set the same byte, to the same value: hence atomic_ref.
Sample look_up(const DecodedFrame& frame, const Vector2d& pixel, double seen,
               std::vector<std::uint8_t>& read) {
  const double left = std::clamp(pixel.x() - 0.5, 0.0, frame.width - 1.0);
  const double top = std::clamp(pixel.y() - 0.5, 0.0, frame.height - 1.0);
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  const double fx = left - x0, fy = top - y0;
  const int x1 = std::min(x0 + 1, frame.width - 1), y1 = std::min(y0 + 1, frame.height - 1);
  const auto code = [&](int x, int y, std::size_t c) {
    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                           static_cast<std::size_t>(x);
    return frame.rgbx[at * 4 + c] / 65535.0;
  };
  const auto mark = [&](int x, int y, double weight) {
    if (read.empty() || weight == 0) return;
    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                           static_cast<std::size_t>(x);
    std::atomic_ref(read[at]).store(1, std::memory_order_relaxed);
  };
  mark(x0, y0, (1 - fy) * (1 - fx));
  mark(x1, y0, (1 - fy) * fx);
  mark(x0, y1, fy * (1 - fx));
  mark(x1, y1, fy * fx);
  Sample sample;
  sample.seen = seen;
  for (std::size_t c = 0; c < 3; ++c) {
    sample.rgb[c] = (1 - fy) * ((1 - fx) * code(x0, y0, c) + fx * code(x1, y0, c)) +
                    fy * ((1 - fx) * code(x0, y1, c) + fx * code(x1, y1, c));
  }
  return sample;
}

/// How far a camera sees along a direction, 0 to 1, and where in its image.
double visibility(const CameraModel& model, const Vector3d& direction_in_camera, Vector2d& pixel) {
  if (direction_in_camera.z() >= 0) return 0;
  const Vector2d ideal(direction_in_camera.x() / -direction_in_camera.z(),
                       direction_in_camera.y() / direction_in_camera.z());
  const std::optional<Vector2d> projected = model.pixel_from_ideal(ideal);
  if (!projected) return 0;
  pixel = *projected;
  const double to_border =
      std::min({pixel.x(), model.width() - pixel.x(), pixel.y(), model.height() - pixel.y()});
  const double border = std::clamp(to_border * kBorderFade, 0.0, 1.0);
  const double to_fold = 1 - ideal.squaredNorm() / model.fold_radius_squared();
  const double fold = model.has_distortion() ? std::clamp(to_fold * kFoldFade, 0.0, 1.0) : 1.0;
  return border * fold;
}

/// The point that is `n.X + c = 0` on the ray, as a direction from each camera: (X - C) for a
/// finite plane, the ray itself for one at infinity. nullopt where the ray does not meet the plane
/// ahead.
class PlaneHit {
 public:
  PlaneHit(const Vector3d& eye, const Vector3d& ray, const Vector4d& plane) {
    const Vector3d normal = plane.head<3>();
    if (normal.isZero(0)) {
      direction_ = ray;
      depth_ = std::numeric_limits<double>::infinity();
      return;
    }
    depth_ = -height_above_plane(plane, eye) / normal.normalized().dot(ray);
    from_eye_ = depth_ * ray;
    eye_ = eye;
  }
  bool ahead() const { return depth_ > 0; }
  double depth() const { return depth_; }
  Vector3d seen_from(const Vector3d& centre) const {
    return direction_ ? *direction_ : Vector3d(from_eye_ + (eye_ - centre));
  }

 private:
  std::optional<Vector3d> direction_;
  Vector3d from_eye_ = Vector3d::Zero(), eye_ = Vector3d::Zero();
  double depth_ = 0;
};

}  // namespace

RenderedView render_focal_plane_reference(const VirtualCamera& view, const Instant& instant,
                                          const Vector4d& plane, CornerWeights weights,
                                          bool count_needed_pixels) {
  RenderedView image = empty_view(view);
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::shared_ptr<const DecodedFrame>> frames(instant.rig->cameras.size());
  ReadPixels read(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const int camera = static_cast<int>(i), frame = instant.frame_of_camera[i];
    if (frame < 0) continue;
    const auto layout = instant.cache->layout(camera, frame);
    frames[i] = instant.cache->fetch(camera, frame,
                                     McuMask(static_cast<std::size_t>(layout->mcu_count()), 1),
                                     image.statistics.pixels_decoded);
    ++image.statistics.cameras_used;
    if (!count_needed_pixels) continue;
    read[i].assign(
        static_cast<std::size_t>(frames[i]->width) * static_cast<std::size_t>(frames[i]->height),
        0);
  }
  const auto decoded = std::chrono::steady_clock::now();

  // Which cells a ray crosses is a question about the ray, so it is asked of an undistorted twin of
  // the view at the pixel that the ray has there.
  VirtualCamera ideal_view = view;
  ideal_view.intrinsics.distortion = {};
  const CameraModel view_model({"view", view.width, view.height, view.intrinsics, {}, {}, {}});
  const RayCells present(ideal_view, *instant.rig, *instant.present);
  const RayCells complete(ideal_view, *instant.rig, *instant.complete);
  const double full_scale = instant.cache->full_scale();
  const bool perceptual = instant.cache->blend_space() == BlendSpace::kPerceptual;

  const auto reconstruct = [&](int x, int y, float* rgba, float& coverage, float& z) {
    const auto ray_in_view = view_model.unproject({x + 0.5, y + 0.5});
    if (!ray_in_view) return;
    const Intrinsics& k = view.intrinsics;
    const double ideal_x = ray_in_view->x() * k.fx + k.cx;
    const double ideal_y = -ray_in_view->y() * k.fy + k.cy;
    auto crossing = present.locate(ideal_x, ideal_y);
    if (!crossing) return;
    if (weights == CornerWeights::kNearest) crossing = present.nearest(*crossing);
    const Vector3d ray = view.pose.world_from_camera_rotation * *ray_in_view;
    const PlaneHit hit(view.pose.position, ray, plane);
    if (!hit.ahead()) return;

    const RayCells::Cell& cell = present.cells()[static_cast<std::size_t>(crossing->cell)];
    std::array<double, 4> sum{};
    for (std::size_t i = 0; i < static_cast<std::size_t>(cell.count); ++i) {
      const auto camera = static_cast<std::size_t>(cell.camera[i]);
      const Rig::Camera& source = instant.rig->cameras[camera];
      const Vector3d towards =
          source.pose.world_from_camera_rotation.transpose() * hit.seen_from(source.pose.position);
      Vector2d pixel;
      const double seen = visibility(source.model, towards, pixel);
      if (seen <= 0) continue;
      const Sample sample = look_up(*frames[camera], pixel, seen, read[camera]);
      const double weight = crossing->weight[i] * sample.seen;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * sample.rgb[c];
      sum[3] += weight;
    }
    if (sum[3] > 0) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double mean = sum[c] / sum[3];
        const double linear = perceptual ? linear_from_srgb(mean) : mean;
        rgba[c] = static_cast<float>(linear * full_scale * sum[3]);
      }
    }
    rgba[3] = static_cast<float>(sum[3]);
    coverage = rgba[3];
    if (instant.present != instant.complete) {
      if (auto whole = complete.locate(ideal_x, ideal_y)) {
        if (weights == CornerWeights::kNearest) whole = complete.nearest(*whole);
        const RayCells::Cell& whole_cell = complete.cells()[static_cast<std::size_t>(whole->cell)];
        for (std::size_t i = 0; i < static_cast<std::size_t>(whole_cell.count); ++i) {
          if (instant.is_present(whole_cell.camera[i])) continue;
          coverage -= rgba[3] * static_cast<float>(whole->weight[i]);
        }
        coverage = std::max(0.0F, coverage);  // all absent, and rounded
      }
    }
    if (rgba[3] > 0) z = static_cast<float>(hit.depth());
  };

  raystage::parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                             static_cast<std::size_t>(x);
      reconstruct(x, y, &image.rgba[at * 4], image.coverage[at], image.z[at]);
    }
  });
  const auto end = std::chrono::steady_clock::now();
  for (const auto& pixels : read) {
    image.statistics.pixels_needed += std::count(pixels.begin(), pixels.end(), 1);
  }
  image.statistics.decode_ms = std::chrono::duration<double, std::milli>(decoded - start).count();
  image.statistics.render_ms = std::chrono::duration<double, std::milli>(end - decoded).count();
  return image;
}

}  // namespace raystage
