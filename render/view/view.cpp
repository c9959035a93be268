// SPDX-License-Identifier: Apache-2.0
#include "render/view/view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "schemas/parallel.h"

namespace raystage {

VirtualCamera virtual_camera_from_geometry(const CameraGeometry& geometry) {
  return {geometry.width, geometry.height, geometry.intrinsics,
          pose_from_matrix(geometry.world_from_camera)};
}

VirtualCamera virtual_camera_with_fov(int width, int height, double horizontal_fov,
                                      const Pose& pose) {
  const double focal_length = width / (2 * std::tan(horizontal_fov / 2));
  return {width, height, {focal_length, focal_length, width / 2.0, height / 2.0, {}}, pose};
}

std::size_t bytes_of_view(const VirtualCamera& view) {
  return static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height) * 6 *
         sizeof(float);
}

RenderedView empty_view(const VirtualCamera& view) {
  RenderedView image = unset_view(view);
  // By all threads: memory that is new to the process is fetched page by page as it is written.
  constexpr int kRowsPerTask = 64;
  const auto width = static_cast<std::ptrdiff_t>(view.width);
  raystage::parallel_for(tbb::blocked_range<int>(0, view.height, kRowsPerTask),
                         [&](const tbb::blocked_range<int>& rows) {
                           const auto fill = [&](PixelValues& values, std::ptrdiff_t channels,
                                                 float value) {
                             std::fill(values.begin() + rows.begin() * width * channels,
                                       values.begin() + rows.end() * width * channels, value);
                           };
                           fill(image.rgba, 4, 0.0F);
                           fill(image.coverage, 1, 0.0F);
                           fill(image.z, 1, std::numeric_limits<float>::infinity());
                         });
  return image;
}

RenderedView unset_view(const VirtualCamera& view) {
  RenderedView image;
  image.width = view.width;
  image.height = view.height;
  const std::size_t pixels =
      static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height);
  image.rgba.resize(pixels * 4);
  image.coverage.resize(pixels);
  image.z.resize(pixels);
  return image;
}

}  // namespace raystage
