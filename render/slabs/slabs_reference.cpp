// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "base/parallel.h"
#include "base/transfer_function.h"
#include "render/common/plane_projection.h"
#include "render/sampling/source_view.h"
#include "render/slabs/slab_coverage.h"
#include "render/slabs/slab_rays.h"
#include "render/slabs/slabs.h"

namespace raystage {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

/// Weighted codes, full scale 1; the fourth value is the weight.
using Sum = std::array<double, 4>;

/// Visibility along one image axis: 1 inside, falling to 0 over the outermost half pixel.
double fade(double at, int size) {
  return std::clamp(std::min(at, size - at) * kBorderFade, 0.0, 1.0);
}

std::size_t pixels_of(const DecodedFrame& frame) {
  return static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height);
}

class ReferenceFrame {
 public:
  explicit ReferenceFrame(const ViewRequest& request)
      : request_(request),
        rig_(*request.instant.rig),
        slabs_(rig_slabs(request)),
        interpolation_(slab_interpolation(request.options)),
        view_model_(
            {"view", request.view.width, request.view.height, request.view.intrinsics, {}, {}, {}}),
        frames_(rig_.cameras.size()),
        read_(rig_.cameras.size()) {
    // Nodes are located in an undistorted copy of the view, at the ray's pixel in that copy.
    ideal_view_.intrinsics.distortion = {};
    for (const Slab& slab : slabs_->slabs) {
      rays_.emplace_back(ideal_view_, slab);
      projections_.emplace_back(ideal_view_, slab_focal_plane(slab, request));
    }
  }

  RenderedView render() {
    RenderedView image = empty_view(request_.view);
    if (request_.measure_coverage) {
      image.cameras.assign(image.coverage.size(), 0.0F);
      image.nearest_ray = image.z;  // infinity
    }
    const auto start = std::chrono::steady_clock::now();
    decode(image.statistics);
    const auto decoded = std::chrono::steady_clock::now();
    raystage::parallel_for(0, image.height, [&](int y) {
      for (int x = 0; x < image.width; ++x) {
        const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                               static_cast<std::size_t>(x);
        std::map<int, double> behind;
        const Vector3d ray =
            reconstruct(x, y, &image.rgba[at * 4], image.coverage[at], image.z[at], behind);
        if (!request_.measure_coverage) continue;
        std::vector<RayCamera> cameras;
        for (const auto& [camera, weight] : behind) cameras.push_back({camera, weight});
        const RayCoverage coverage = measure_ray_coverage(cameras, request_, ray);
        image.cameras[at] = coverage.cameras();
        image.nearest_ray[at] = coverage.nearest_ray();
      }
    });
    const auto end = std::chrono::steady_clock::now();
    for (const auto& read : read_) {
      image.statistics.pixels_needed += std::count(read.begin(), read.end(), 1);
    }
    image.statistics.decode_ms = std::chrono::duration<double, std::milli>(decoded - start).count();
    image.statistics.render_ms = std::chrono::duration<double, std::milli>(end - decoded).count();
    return image;
  }

 private:
  void decode(RenderStatistics& statistics) {
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      const int camera = static_cast<int>(i), frame = request_.instant.frame_of_camera[i];
      if (frame < 0) continue;
      const auto layout = request_.instant.cache->layout(camera, frame);
      frames_[i] = request_.instant.cache->fetch(
          camera, frame, McuMask(static_cast<std::size_t>(layout->mcu_count()), 1),
          statistics.pixels_decoded);
      if (request_.count_needed_pixels) read_[i].resize(pixels_of(*frames_[i]));
      ++statistics.cameras_used;
    }
  }

  /// Returns the ray; `behind`: what weight each camera has in it.
  Vector3d reconstruct(int x, int y, float* rgba, float& coverage, float& z,
                       std::map<int, double>& behind) const {
    const auto ray_in_view = view_model_.unproject({x + 0.5, y + 0.5});
    if (!ray_in_view) return Vector3d::Zero();
    const Intrinsics& k = request_.view.intrinsics;
    const double ideal_x = ray_in_view->x() * k.fx + k.cx;
    const double ideal_y = -ray_in_view->y() * k.fy + k.cy;
    const Vector3d ray = request_.view.pose.world_from_camera_rotation * *ray_in_view;
    for (std::size_t i = 0; i < rays_.size(); ++i) {
      if (slabs_->slabs[i].width == 0 || !rays_[i].contains_ray(ideal_x, ideal_y)) continue;
      const PlaneProjection& projection = projections_[i];
      const double depth = projection.depth(ideal_x, ideal_y);
      if (!(depth > 0) || (!projection.at_infinity() && projection.distance() == 0)) return ray;
      const SlabRays::Crossing crossing = rays_[i].crossing(ideal_x, ideal_y);
      answer(i, crossing, ray, depth, rgba, coverage, behind);
      if (rgba[3] > 0) z = static_cast<float>(depth);
      return ray;
    }
    return ray;
  }

  /// Interpolates the four nodes around the crossing.
  void answer(std::size_t slab_index, const SlabRays::Crossing& crossing, const Vector3d& ray,
              double depth, float* rgba, float& coverage, std::map<int, double>& behind) const {
    const Slab& slab = slabs_->slabs[slab_index];
    Sum sum{};
    double lacking = 0;
    const int left = std::min(static_cast<int>(crossing.column), std::max(0, slab.columns - 2));
    const int upper = std::min(static_cast<int>(crossing.row), std::max(0, slab.rows - 2));
    for (int row = upper; row < std::min(upper + 2, slab.rows); ++row) {
      for (int column = left; column < std::min(left + 2, slab.columns); ++column) {
        const double weight =
            hat(crossing.column - left, column - left) * hat(crossing.row - upper, row - upper);
        if (weight == 0) continue;
        const NodeSources& sources =
            slabs_->nodes[slab_index][static_cast<std::size_t>(row * slab.columns + column)];
        std::array<double, 3> seen_by{};
        const Sum seen =
            look_up(slab, slab.node_position(column, row), sources, ray, depth, seen_by);
        for (std::size_t c = 0; c < 4; ++c) sum[c] += weight * seen[c];
        for (std::size_t c = 0; c < 3; ++c) behind[sources.camera[c]] += weight * seen_by[c];
        lacking += weight * (1 - sources.present_weight);
      }
    }
    if (!(sum[3] > 0)) return;
    const FrameCache& cache = *request_.instant.cache;
    for (std::size_t c = 0; c < 3; ++c) {
      const double mean = sum[c] / sum[3];
      const double linear =
          cache.blend_space() == BlendSpace::kPerceptual ? linear_from_srgb(mean) : mean;
      rgba[c] = static_cast<float>(linear * cache.full_scale() * sum[3]);
    }
    rgba[3] = static_cast<float>(sum[3]);
    coverage = static_cast<float>(sum[3] * (1 - lacking));
  }

  /// Weight of the node `offset` (0 or 1) for a crossing at `place` in [0, 1].
  double hat(double place, int offset) const {
    const double second =
        interpolation_ == SlabInterpolation::kNearest ? (place >= 0.5 ? 1.0 : 0.0) : place;
    return offset == 0 ? 1 - second : second;
  }

  /// What a node sees of the ray's point, from the frames of its cameras; `seen_by`: the weight of
  /// each.
  Sum look_up(const Slab& slab, const Vector3d& node, const NodeSources& sources,
              const Vector3d& ray, double depth, std::array<double, 3>& seen_by) const {
    const Vector3d& eye = request_.view.pose.position;
    const auto seen_from = [&](const Vector3d& centre) {
      return std::isinf(depth) ? ray : Vector3d(depth * ray + (eye - centre));
    };
    // It must lie in the node's image, and is looked up at a sample's centre where nothing is
    // interpolated between samples.
    Vector3d in_node = slab.pose.world_from_camera_rotation.transpose() * seen_from(node);
    if (!(in_node.z() < 0)) return {};
    const Intrinsics& k = slab.image;
    Vector2d uv(k.fx * in_node.x() / -in_node.z() + k.cx, k.fy * in_node.y() / in_node.z() + k.cy);
    const double in_image = fade(uv.x(), slab.width) * fade(uv.y(), slab.height);
    if (!(in_image > 0)) return {};
    if (interpolation_ != SlabInterpolation::kQuadrilinear) {
      uv = {std::clamp(std::floor(uv.x()), 0.0, slab.width - 1.0) + 0.5,
            std::clamp(std::floor(uv.y()), 0.0, slab.height - 1.0) + 0.5};
      in_node = {(uv.x() - k.cx) / k.fx, -(uv.y() - k.cy) / k.fy, -1};
    }
    const Vector3d from_node = slab.pose.world_from_camera_rotation * in_node;
    Sum sum{};
    for (std::size_t i = 0; i < static_cast<std::size_t>(sources.count); ++i) {
      const auto camera = static_cast<std::size_t>(sources.camera[i]);
      const Pose& pose = rig_.cameras[camera].pose;
      const auto towards =
          sources.at_camera ? from_node : point_from(slab, node, from_node, pose.position);
      if (!towards) continue;
      const double before = sum[3];
      add(camera, pose.world_from_camera_rotation.transpose() * *towards, sources.weight[i],
          in_image, sum);
      seen_by[i] = sum[3] - before;
    }
    return sum;
  }

  /// Direction from `centre` to where the node's ray meets the focal plane; nullopt where it does
  /// not.
  std::optional<Vector3d> point_from(const Slab& slab, const Vector3d& node,
                                     const Vector3d& from_node, const Vector3d& centre) const {
    const Eigen::Vector4d plane = slab_focal_plane(slab, request_);
    const Vector3d normal = plane.head<3>();
    if (normal.isZero(0)) return from_node;
    const double along = -(normal.dot(node) + plane.w()) / normal.dot(from_node);
    if (!(along > 0)) return std::nullopt;
    return along * from_node + (node - centre);
  }

  void add(std::size_t camera, const Vector3d& in_camera, double weight, double in_image,
           Sum& sum) const {
    if (!(in_camera.z() < 0)) return;
    const CameraModel& model = rig_.cameras[camera].model;
    const Vector2d ideal(in_camera.x() / -in_camera.z(), in_camera.y() / in_camera.z());
    const auto pixel = model.pixel_from_ideal(ideal);
    if (!pixel) return;
    const double to_fold = 1 - ideal.squaredNorm() / model.fold_radius_squared();
    const double fold = model.has_distortion() ? std::clamp(to_fold * kFoldFade, 0.0, 1.0) : 1.0;
    // Where the node's image ends where the camera's does, the two fades are one.
    const double border =
        std::min({in_image, fade(pixel->x(), model.width()), fade(pixel->y(), model.height())});
    const double seen = weight * fold * border;
    if (!(seen > 0)) return;
    const DecodedFrame& frame = *frames_[camera];
    const double left = std::clamp(pixel->x() - 0.5, 0.0, frame.width - 1.0);
    const double top = std::clamp(pixel->y() - 0.5, 0.0, frame.height - 1.0);
    const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
    const int x1 = std::min(x0 + 1, frame.width - 1), y1 = std::min(y0 + 1, frame.height - 1);
    const double fx = left - x0, fy = top - y0;
    const auto code = [&](int x, int y, std::size_t c) {
      const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                             static_cast<std::size_t>(x);
      return frame.rgba[at * 4 + c] / 65535.0;
    };
    for (std::size_t c = 0; c < 4; ++c) {
      sum[c] += seen * ((1 - fy) * ((1 - fx) * code(x0, y0, c) + fx * code(x1, y0, c)) +
                        fy * ((1 - fx) * code(x0, y1, c) + fx * code(x1, y1, c)));
    }
    std::vector<std::uint8_t>& read = read_[camera];
    if (read.empty()) return;
    for (const int y : {y0, fy > 0 ? y1 : y0}) {
      for (const int x : {x0, fx > 0 ? x1 : x0}) {
        const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                               static_cast<std::size_t>(x);
        // Rays of other threads may set the same byte.
        std::atomic_ref(read[at]).store(1, std::memory_order_relaxed);
      }
    }
  }

  const ViewRequest& request_;
  const Rig& rig_;
  std::shared_ptr<const RigSlabs> slabs_;
  SlabInterpolation interpolation_;
  VirtualCamera ideal_view_ = request_.view;
  CameraModel view_model_;
  std::vector<SlabRays> rays_;                // per slab
  std::vector<PlaneProjection> projections_;  // per slab
  std::vector<std::shared_ptr<const DecodedFrame>> frames_;
  /// For counting: per camera and pixel whether a ray reads it; empty: not counted.
  mutable std::vector<std::vector<std::uint8_t>> read_;
};

}  // namespace

RenderedView render_slabs_reference(const ViewRequest& request) {
  return ReferenceFrame(request).render();
}

}  // namespace raystage
