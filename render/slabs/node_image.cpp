// SPDX-License-Identifier: Apache-2.0
#include "render/slabs/node_image.h"

#include <algorithm>
#include <chrono>
#include <cstring>

#include "render/sampling/source_view.h"
#include "render/view/plane_projection.h"
#include "schemas/parallel.h"

namespace raystage {
namespace {

constexpr Eigen::Vector4d::Scalar kOne = 1;

/// A node that is a camera turns its image about its own centre: as if all were at infinity.
Eigen::Vector4d plane_for(const NodeSources& sources, const Eigen::Vector4d& focal_plane) {
  return sources.at_camera ? Eigen::Vector4d(0, 0, 0, kOne) : focal_plane;
}

template <class T>
void append(std::string& key, const T& value) {
  static_assert(std::is_arithmetic_v<T>);
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  key.append(bytes, sizeof(T));
}

std::size_t samples_of(const Slab& slab) {
  return static_cast<std::size_t>(slab.width) * (static_cast<std::size_t>(slab.height) + 1) + 1;
}

}  // namespace

std::size_t node_image_bytes(const Slab& slab) {
  return samples_of(slab) * 4 * sizeof(std::uint16_t);
}

std::shared_ptr<const NodeImage> make_node_image(const Instant& instant, const Slab& slab,
                                                 int column, int row, const NodeSources& sources,
                                                 const Eigen::Vector4d& focal_plane) {
  auto image = std::make_shared<NodeImage>();
  image->width = slab.width;
  image->height = slab.height;
  image->bytes = node_image_bytes(slab);
  image->rgba = std::make_unique_for_overwrite<std::uint16_t[]>(samples_of(slab) * 4);
  const std::size_t used =
      static_cast<std::size_t>(slab.width) * static_cast<std::size_t>(slab.height) * 4;
  std::fill_n(image->rgba.get() + used, samples_of(slab) * 4 - used, std::uint16_t{0});

  const auto start = std::chrono::steady_clock::now();
  const auto count = static_cast<std::size_t>(sources.count);
  const VirtualCamera node = slab.node_view(column, row);
  const PlaneProjection projection(node, plane_for(sources, focal_plane));
  std::array<std::shared_ptr<const DecodedFrame>, 3> frames;
  std::array<SourceView, 3> views;
  PixelRun run;
  run.end = slab.width;
  run.count = sources.count;
  run.total = {0, 0, 1};
  for (std::size_t i = 0; i < count; ++i) {
    const auto camera = static_cast<std::size_t>(sources.camera[i]);
    const int frame = instant.frame_of_camera[camera];
    const auto layout = instant.cache->layout(sources.camera[i], frame);
    frames[i] = instant.cache->fetch(sources.camera[i], frame,
                                     McuMask(static_cast<std::size_t>(layout->mcu_count()), 1),
                                     image->pixels_decoded);
    const Rig::Camera& source = instant.rig->cameras[camera];
    views[i] = source_view_of(source.model, projection.ideal_from_pixel(source.pose));
    views[i].rgbx = frames[i]->rgbx.get();
    run.source[i] = &views[i];
    run.share[i] = {0, 0, sources.weight[i]};
  }
  const auto decoded = std::chrono::steady_clock::now();
  image->decode_ms = std::chrono::duration<double, std::milli>(decoded - start).count();
  run.slope = {projection.slope().x(), projection.slope().y(), projection.slope().z()};
  run.distance = projection.distance();
  run.at_infinity = projection.at_infinity();
  if (!run.at_infinity &&
      run.distance == 0) {  // the node lies on the plane: it sees no point of it
    std::fill_n(image->rgba.get(), used, std::uint16_t{0});
    return image;
  }
  constexpr int kRowsPerTask = 32;
  raystage::parallel_for(
      tbb::blocked_range<int>(0, slab.height, kRowsPerTask),
      [&](const tbb::blocked_range<int>& rows) {
        PixelRun of_row = run;
        for (int y = rows.begin(); y < rows.end(); ++y) {
          of_row.y = y;
          codes_of_run(of_row, image->rgba.get() + static_cast<std::size_t>(y) *
                                                       static_cast<std::size_t>(slab.width) * 4);
        }
      });
  return image;
}

std::string node_image_key(const Instant& instant, const Slab& slab, int column, int row,
                           const NodeSources& sources, const Eigen::Vector4d& focal_plane) {
  std::string key = "slabs: image of a node\n";
  const VirtualCamera node = slab.node_view(column, row);
  for (int i = 0; i < 3; ++i) append(key, node.pose.position[i]);
  for (int i = 0; i < 9; ++i) append(key, node.pose.world_from_camera_rotation(i / 3, i % 3));
  for (const double k : {slab.image.fx, slab.image.fy, slab.image.cx, slab.image.cy})
    append(key, k);
  append(key, slab.width);
  append(key, slab.height);
  for (std::size_t i = 0; i < static_cast<std::size_t>(sources.count); ++i) {
    append(key, sources.camera[i]);
    append(key, instant.frame_of_camera[static_cast<std::size_t>(sources.camera[i])]);
    append(key, sources.weight[i]);
  }
  const Eigen::Vector4d plane = plane_for(sources, focal_plane);
  for (int i = 0; i < 4; ++i) append(key, plane[i]);
  return key;
}

}  // namespace raystage
