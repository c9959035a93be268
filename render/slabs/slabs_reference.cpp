// SPDX-License-Identifier: Apache-2.0
// Reference of slabs.cpp (thesis 2.3, appendix A): per ray in double, no rectified images;
// each node is sampled in its cameras' frames. Cost: pixels x 4 nodes x up to 3 cameras.
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "render/common/plane_projection.h"
#include "render/sampling/direction_visibility.h"
#include "render/sampling/reference_renderer.h"
#include "render/sampling/source_view.h"
#include "render/slabs/slab_coverage.h"
#include "render/slabs/slab_rays.h"
#include "render/slabs/slabs.h"

namespace raystage::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

/// Weighted codes, full scale 1; the fourth value is the weight.
using Sum = std::array<double, 4>;

/// Returns the visibility along one image axis: 1 inside, falling to 0 over the outermost half
/// pixel.
double fade(double at, int size) {
  return std::clamp(std::min(at, size - at) * kBorderFade, 0.0, 1.0);
}

class SlabsReference {
 public:
  explicit SlabsReference(const ViewRequest& request)
      : request_(request),
        rig_(*request.instant.rig),
        slabs_(rig_slabs(request)),
        interpolation_(slab_interpolation(request.options)),
        renderer_(request) {
    // Nodes are located in an undistorted copy of the view, at the ray's pixel in that copy.
    ideal_view_.intrinsics.distortion = {};
    for (const Slab& slab : slabs_->slabs) {
      rays_.emplace_back(ideal_view_, slab);
      projections_.emplace_back(ideal_view_, slab_focal_plane(slab, request));
    }
  }

  RenderedView render() {
    return renderer_.render([&](const ReferenceRay& ray, ReferencePixel& pixel) {
      std::map<int, double> behind;
      reconstruct(ray, pixel, behind);
      if (!request_.measure_coverage) return;
      std::vector<RayCamera> cameras;
      for (const auto& [camera, weight] : behind) cameras.push_back({camera, weight});
      const RayCoverage coverage = measure_ray_coverage(cameras, request_, ray.direction);
      pixel.cameras = coverage.cameras();
      pixel.nearest_ray = coverage.nearest_ray();
    });
  }

 private:
  /// Reconstructs a pixel; `behind`: the weight of each camera.
  void reconstruct(const ReferenceRay& ray, ReferencePixel& pixel, std::map<int, double>& behind) {
    const Vector2d& at = ray.ideal_pixel;
    for (std::size_t i = 0; i < rays_.size(); ++i) {
      if (slabs_->slabs[i].width == 0 || !rays_[i].contains_ray(at.x(), at.y())) continue;
      const PlaneProjection& projection = projections_[i];
      const double depth = projection.depth(at.x(), at.y());
      if (!(depth > 0) || (!projection.at_infinity() && projection.distance() == 0)) return;
      answer(i, rays_[i].crossing(at.x(), at.y()), ray.direction, depth, pixel, behind);
      return;
    }
  }

  /// Interpolates the four nodes around the crossing.
  void answer(std::size_t slab_index, const SlabRays::Crossing& crossing, const Vector3d& ray,
              double depth, ReferencePixel& pixel, std::map<int, double>& behind) {
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
        const NodeSources& sources = slabs_->nodes[slab_index][row * slab.columns + column];
        std::array<double, 3> seen_by{};
        const Sum seen =
            look_up(slab, slab.node_position(column, row), sources, ray, depth, seen_by);
        for (std::size_t c = 0; c < 4; ++c) sum[c] += weight * seen[c];
        for (std::size_t c = 0; c < 3; ++c) behind[sources.camera[c]] += weight * seen_by[c];
        lacking += weight * (1 - sources.present_weight);
      }
    }
    if (!(sum[3] > 0)) return;
    pixel.rgba = premultiplied_light({sum[0] / sum[3], sum[1] / sum[3], sum[2] / sum[3]}, sum[3],
                                     *request_.instant.cache);
    pixel.coverage = static_cast<float>(sum[3] * (1 - lacking));
    pixel.z = static_cast<float>(depth);
  }

  /// Returns the weight of node `offset` (0 or 1) for a crossing at `place` in [0, 1].
  double hat(double place, int offset) const {
    const double second =
        interpolation_ == SlabInterpolation::kNearest ? (place >= 0.5 ? 1.0 : 0.0) : place;
    return offset == 0 ? 1 - second : second;
  }

  /// Samples the ray's point for a node, in the frames of its cameras; `seen_by`: their weights.
  Sum look_up(const Slab& slab, const Vector3d& node, const NodeSources& sources,
              const Vector3d& ray, double depth, std::array<double, 3>& seen_by) {
    const Vector3d& eye = request_.view.pose.position;
    const auto seen_from = [&](const Vector3d& centre) {
      return std::isinf(depth) ? ray : Vector3d(depth * ray + (eye - centre));
    };
    // The point must lie in the node's image. Without interpolation between samples, the centre of
    // the nearest sample is used.
    Vector3d in_node = slab.pose.world_from_camera_rotation.transpose() * seen_from(node);
    if (!(in_node.z() < 0)) return {};
    const schemas::Intrinsics& k = slab.image;
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
    for (int i = 0; i < sources.count; ++i) {
      const auto camera = static_cast<std::size_t>(sources.camera[i]);
      const rig::Pose& pose = rig_.cameras[camera].pose;
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

  /// Returns the direction from `centre` to where the node's ray meets the focal plane, or nullopt.
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
           Sum& sum) {
    const rig::CameraModel& model = rig_.cameras[camera].model;
    const auto pixel = model.project(in_camera);
    if (!pixel) return;
    const double fold = lens_visibility(model, in_camera);
    // If the borders of the node's image and of the frame coincide, only one fade applies.
    const double border =
        std::min({in_image, fade(pixel->x(), model.width()), fade(pixel->y(), model.height())});
    const double seen = weight * fold * border;
    if (!(seen > 0)) return;
    const FrameSample sample = renderer_.frames().sample(camera, *pixel);
    for (std::size_t c = 0; c < 3; ++c) sum[c] += seen * sample.rgb[c];
    sum[3] += seen * sample.alpha;
  }

  const ViewRequest& request_;
  const rig::Rig& rig_;
  std::shared_ptr<const RigSlabs> slabs_;
  SlabInterpolation interpolation_;
  VirtualCamera ideal_view_ = request_.view;
  std::vector<SlabRays> rays_;                // per slab
  std::vector<PlaneProjection> projections_;  // per slab
  ReferenceRenderer renderer_;
};

}  // namespace

RenderedView render_slabs_reference(const ViewRequest& request) {
  return SlabsReference(request).render();
}

}  // namespace raystage::render
