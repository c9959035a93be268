// SPDX-License-Identifier: Apache-2.0
#include "testing/render/kernel_accuracy.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "testing/render/exact_geometry.h"
#include "testing/render/kernel_probe.h"

namespace raystage::testing {
namespace {

constexpr int kEnlarged = 15;
constexpr schemas::Distortion kLens{-0.2, 0.05, 0.001, -0.002, 0.003};

rig::Rig rig_of(const ExtremeView& extreme) {
  const SyntheticTake take = make_extreme_array(extreme.array);
  schemas::RigDocument document;
  for (schemas::CameraGeometry camera : take.cameras) {
    camera.width *= kEnlarged;
    camera.height *= kEnlarged;
    for (double* length : {&camera.intrinsics.fx, &camera.intrinsics.fy, &camera.intrinsics.cx,
                           &camera.intrinsics.cy}) {
      *length *= kEnlarged;
    }
    camera.intrinsics.distortion = kLens;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      camera.world_from_camera[4 * axis + 3] += take.origin[axis];
    }
    document.cameras.push_back({camera, {}});
  }
  return rig::rig_from_document(document);
}

void raise(double& worst, double error) {
  // Not std::max, which ignores NaN.
  if (!(error <= worst)) worst = error;
}

double difference(double value, const Real& truth) {
  return static_cast<double>(abs(Real(value) - truth));
}

class PixelComparison {
 public:
  PixelComparison(const ExtremeView& extreme, const rig::Rig& rig, const rig::Topology& topology,
                  const render::RayCells& cells, const render::PlaneProjection& projection)
      : extreme_(extreme), rig_(rig), topology_(topology), cells_(cells), projection_(projection) {}

  void add(const ProbedPixel& pixel, ViewAccuracy& accuracy) const {
    const double x = pixel.x + 0.5, y = pixel.y + 0.5;
    const ExactVector ray = exact_ray(extreme_.view, x, y);
    const Eigen::Vector3d& eye = extreme_.view.pose.position;
    const render::RayCells::Cell& cell = cells_.cells()[pixel.cell];
    const auto count = static_cast<std::size_t>(cell.count);
    GeometryErrors &in_double = accuracy.in_double, &in_kernels = accuracy.in_kernels;

    std::array<Eigen::Vector3d, 3> centres;
    for (std::size_t i = 0; i < count; ++i) centres[i] = camera(cell, i).pose.position;
    const auto crossing = cells_.crossing_in_cell(pixel.cell, x, y);
    double sum = -1, kernel_sum = -1;
    if (const auto truth = exact_weights(centres, cell.count, topology_.up, eye, ray)) {
      for (std::size_t i = 0; i < count; ++i) {
        raise(in_double.weight, difference(crossing.weight[i], (*truth)[i]));
        raise(in_kernels.weight, difference(static_cast<double>(pixel.weight[i]), (*truth)[i]));
        ++in_double.weights_compared;
        ++in_kernels.weights_compared;
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      sum += crossing.weight[i];
      kernel_sum += static_cast<double>(pixel.weight[i]);
    }
    raise(in_double.weight_sum, std::abs(sum));
    raise(in_kernels.weight_sum, std::abs(kernel_sum));

    if (!projection_.at_infinity()) {
      const auto depth = exact_depth(extreme_.plane, eye, ray);
      if (depth && *depth > 0) {
        raise(in_double.depth,
              static_cast<double>(abs(Real(projection_.depth(x, y)) / *depth - 1)));
        if (pixel.seen[0] > 0) {
          raise(in_kernels.depth,
                static_cast<double>(abs(Real(static_cast<double>(pixel.z)) / *depth - 1)));
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      compare_position(camera(cell, i), ray, {x, y, 1},
                       pixel.seen[i] > 0.999F
                           ? std::optional(std::array<double, 2>{static_cast<double>(pixel.u[i]),
                                                                 static_cast<double>(pixel.v[i])})
                           : std::nullopt,
                       accuracy);
    }
  }

 private:
  const rig::Rig::Camera& camera(const render::RayCells::Cell& cell, std::size_t i) const {
    return rig_.cameras[cell.camera[i]];
  }

  void compare_position(const rig::Rig::Camera& camera, const ExactVector& ray,
                        const Eigen::Vector3d& pixel,
                        const std::optional<std::array<double, 2>>& by_kernel,
                        ViewAccuracy& accuracy) const {
    const auto truth = exact_pixel(camera.model.intrinsics(), camera.pose, extreme_.plane,
                                   extreme_.view.pose.position, ray);
    // Only positions well within the image: the kernels fade out at the border.
    if (!truth || (*truth)[0] < 1 || (*truth)[1] < 1 || (*truth)[0] > camera.model.width() - 1 ||
        (*truth)[1] > camera.model.height() - 1) {
      return;
    }
    const Eigen::Vector3d ideal = projection_.ideal_from_pixel(camera.pose) * pixel;
    const Eigen::Vector2d on_image(ideal.x() / ideal.z(), ideal.y() / ideal.z());
    // Beyond the fold radius the distortion polynomial is not valid.
    if (on_image.squaredNorm() > 0.9 * camera.model.fold_radius_squared()) return;
    const auto position = camera.model.pixel_from_ideal(on_image);
    for (int axis = 0; axis < 2; ++axis) {
      const auto i = static_cast<std::size_t>(axis);
      raise(accuracy.in_double.position,
            position ? difference((*position)(axis), (*truth)[i]) : kLost);
      raise(accuracy.in_kernels.position,
            by_kernel ? difference((*by_kernel)[i], (*truth)[i]) : kLost);
    }
    ++accuracy.in_double.positions_compared;
    ++accuracy.in_kernels.positions_compared;
  }

  static constexpr double kLost = 1e9;  // pixels: a camera that sees the point was excluded
  const ExtremeView& extreme_;
  const rig::Rig& rig_;
  const rig::Topology& topology_;
  const render::RayCells& cells_;
  const render::PlaneProjection& projection_;
};

}  // namespace

ViewAccuracy measure_accuracy(const ExtremeView& extreme) {
  const rig::Rig rig = rig_of(extreme);
  std::vector<int> cameras;
  for (int i = 0; i < static_cast<int>(rig.cameras.size()); ++i) cameras.push_back(i);
  const rig::Topology topology = rig::make_topology(rig, cameras);
  const render::RayCells cells(extreme.view, rig, topology);
  const render::PlaneProjection projection(extreme.view, extreme.plane);
  const PixelComparison comparison(extreme, rig, topology, cells, projection);
  ViewAccuracy accuracy;
  if (!projection.at_infinity() && projection.distance() == 0)
    return accuracy;  // no ray meets the plane
  const auto pixels = probe_kernels(extreme.view, rig, cells, projection);
  const std::size_t step = std::max<std::size_t>(1, pixels.size() / 499);
  for (std::size_t i = 0; i < pixels.size(); i += step) comparison.add(pixels[i], accuracy);
  return accuracy;
}

}  // namespace raystage::testing
