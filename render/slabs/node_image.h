// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "render/common/light_field_frame.h"
#include "render/slabs/node_rows.h"
#include "render/slabs/node_sources.h"

namespace raystage {

/// What a node of a slab sees: its cameras' frames rectified onto the slab's image plane (thesis
/// 2.3: Levoy and Hanrahan's rectification; per camera a homography and its distortion).
struct NodeImage {
  int width = 0, height = 0;
  /// R, G, B, A per sample, rows without padding: sums of weighted codes on the scale of the blend
  /// space, A = 65535 where all cameras see. 16 bits as decoded frames have: in 8 the rounding of
  /// every sample would add to that of the camera, and linear light would show steps in its
  /// shadows. One row and one sample of padding follow, so that a bilinear tap may read past the
  /// last.
  std::unique_ptr<std::uint16_t[]> rgba;
  NodeRows made;                    ///< the rest has no meaning
  std::size_t bytes = 0;            ///< of memory held
  std::int64_t pixels_decoded = 0;  ///< for it
  double decode_ms = 0;             ///< wall-clock, for it
};

/// Memory that an image of the slab's nodes takes.
std::size_t node_image_bytes(const Slab& slab);

/// Where a node's image is kept (ResultCache): as much of it as one view reads, for that one; the
/// whole as soon as another view reads more of the same instant. Thread-safe.
class NodeImageCache {
 public:
  /// Null before the first.
  std::shared_ptr<const NodeImage> image() const;
  /// The image from now on, unless one is kept that holds as much.
  void keep(std::shared_ptr<const NodeImage> image) const;

 private:
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const NodeImage> image_;
};

/// Rectifies the samples of `rows`, decoding what they read; each is the same however many others
/// are made. Where several cameras stand in for the node, they are blended where its rays meet
/// `focal_plane` (focal plane reconstruction from where the node is). `sources.count` above 0.
std::shared_ptr<const NodeImage> make_node_image(const LightFieldFrame& instant, const Slab& slab,
                                                 int column, int row, const NodeSources& sources,
                                                 const Eigen::Vector4d& focal_plane,
                                                 const NodeRows& rows);

/// What the image depends on, for ResultCache: frames, weights, node and image plane; the focal
/// plane only where the node is not a camera itself.
std::string node_image_key(const LightFieldFrame& instant, const Slab& slab, int column, int row,
                           const NodeSources& sources, const Eigen::Vector4d& focal_plane);

}  // namespace raystage
