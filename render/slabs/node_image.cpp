// SPDX-License-Identifier: Apache-2.0
// Rectifies camera frames into the image of a node (thesis 2.3; Levoy and Hanrahan 1996) by a
// homography and lens distortion per camera. Uses the kernels of sampling/source_view.h. Output:
// 16-bit R, G, B, A sums per sample. Cost: samples x cameras of the node.

#include "render/slabs/node_image.h"

#include <algorithm>
#include <cstring>

#include "base/parallel.h"
#include "render/common/plane_projection.h"
#include "render/sampling/source_frames.h"
#include "render/sampling/source_view.h"

namespace raystage::render {
namespace {

constexpr Eigen::Vector4d::Scalar kOne = 1;

/// Returns the plane for rectification: infinity for a node at a camera, which is only rotated.
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

/// Samples of a row that are rectified together.
constexpr int kSamplesPerPiece = 32;

/// Calls `body` in parallel with the run of each row that has samples.
template <class Body>
void for_each_row(const NodeRows& rows, const PixelRun& run, const Body& body) {
  constexpr int kRowsPerTask = 32;
  raystage::parallel_for_grains(0, rows.height(), kRowsPerTask, [&](int y) {
    if (rows.row(y).is_empty()) return;
    PixelRun of_row = run;
    of_row.begin = rows.row(y).begin;
    of_row.end = rows.row(y).end;
    of_row.y = y;
    body(of_row);
  });
}

}  // namespace

std::size_t node_image_bytes(const Slab& slab) {
  return samples_of(slab) * 4 * sizeof(std::uint16_t);
}

std::shared_ptr<const NodeImage> NodeImageCache::image() const {
  const std::scoped_lock lock(mutex_);
  return image_;
}

void NodeImageCache::keep(std::shared_ptr<const NodeImage> image) const {
  const std::scoped_lock lock(mutex_);
  if (image_ && image_->made.covers(image->made)) return;
  image_ = std::move(image);
}

std::shared_ptr<const NodeImage> make_node_image(const LightFieldFrame& instant, const Slab& slab,
                                                 int column, int row, const NodeSources& sources,
                                                 const Eigen::Vector4d& focal_plane,
                                                 const NodeRows& rows) {
  auto image = std::make_shared<NodeImage>();
  image->width = slab.width;
  image->height = slab.height;
  image->made = rows;
  image->bytes = node_image_bytes(slab);
  image->rgba = std::make_unique_for_overwrite<std::uint16_t[]>(samples_of(slab) * 4);
  const std::size_t used = static_cast<std::size_t>(slab.width) * slab.height * 4;
  std::fill_n(image->rgba.get() + used, samples_of(slab) * 4 - used, std::uint16_t{0});

  const VirtualCamera node = slab.node_view(column, row);
  const PlaneProjection projection(node, plane_for(sources, focal_plane));
  if (!projection.at_infinity() &&
      projection.distance() == 0) {  // the node lies on the plane and sees none of its points
    std::fill_n(image->rgba.get(), used, std::uint16_t{0});
    return image;
  }
  const auto start = RenderClock::now();
  SourceFrames frames(instant, projection, false);
  const std::vector<int> cameras(sources.camera.begin(), sources.camera.begin() + sources.count);
  frames.open(cameras);
  PixelRun run;
  run.count = sources.count;
  run.total = {0, 0, 1};
  run.slope = {projection.slope().x(), projection.slope().y(), projection.slope().z()};
  run.distance = projection.distance();
  run.at_infinity = projection.at_infinity();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    run.source[i] = &frames.view(cameras[i]);
    run.share[i] = {0, 0, sources.weight[i]};
  }
  if (!frames.are_fully_decoded()) {
    for_each_row(rows, run, [](const PixelRun& of_row) { mark_run(of_row); });
  }
  RenderStatistics decoding;
  frames.decode(decoding);
  image->pixels_decoded = decoding.pixels_decoded;
  image->decode_ms = milliseconds(RenderClock::now() - start);
  for_each_row(rows, run, [&](PixelRun piece) {
    // Rounding depends on where a run begins, so pieces always begin at the same samples.
    const int first = piece.begin / kSamplesPerPiece * kSamplesPerPiece, end = piece.end;
    std::uint16_t* const of_row =
        image->rgba.get() + static_cast<std::size_t>(piece.y) * slab.width * 4;
    for (piece.begin = first; piece.begin < end; piece.begin += kSamplesPerPiece) {
      piece.end = std::min(piece.begin + kSamplesPerPiece, slab.width);
      blend_run_codes(piece, of_row + static_cast<std::size_t>(piece.begin) * 4);
    }
  });
  return image;
}

std::string node_image_key(const LightFieldFrame& instant, const Slab& slab, int column, int row,
                           const NodeSources& sources, const Eigen::Vector4d& focal_plane) {
  std::string key = "slabs: image of a node\n";
  const VirtualCamera node = slab.node_view(column, row);
  for (int i = 0; i < 3; ++i) append(key, node.pose.position[i]);
  for (int i = 0; i < 9; ++i) append(key, node.pose.world_from_camera_rotation(i / 3, i % 3));
  for (const double k : {slab.image.fx, slab.image.fy, slab.image.cx, slab.image.cy})
    append(key, k);
  append(key, slab.width);
  append(key, slab.height);
  for (int i = 0; i < sources.count; ++i) {
    append(key, sources.camera[i]);
    append(key, instant.frame_of_camera[sources.camera[i]]);
    append(key, sources.weight[i]);
  }
  const Eigen::Vector4d plane = plane_for(sources, focal_plane);
  for (int i = 0; i < 4; ++i) append(key, plane[i]);
  return key;
}

}  // namespace raystage::render
