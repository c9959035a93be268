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

namespace raystage::render {

/// The image of a slab's node: its cameras' frames rectified onto the slab's image plane (thesis
/// 2.3: Levoy and Hanrahan's rectification; per camera a homography and its distortion).
struct NodeImage {
  int width = 0, height = 0;
  /// R, G, B, A per sample, rows without padding: sums of weighted codes on the scale of the blend
  /// space, A = 65535 where all cameras see the sample. They have 16 bits as in decoded frames:
  /// with 8, each sample would add its rounding to the camera's, and linear light would have steps
  /// in shadows. One row and one sample of padding follow, so that a bilinear tap may read past the
  /// last.
  std::unique_ptr<std::uint16_t[]> rgba;
  NodeRows made;                    ///< the valid samples; others are undefined
  std::size_t bytes = 0;            ///< of memory held
  std::int64_t pixels_decoded = 0;  ///< pixels decoded for it
  double decode_ms = 0;             ///< wall-clock time of decoding for it
};

/// Returns the memory of one node image of the slab.
std::size_t node_image_bytes(const Slab& slab);

/// Holds a node's image in the ResultCache: at first the part that one view reads, and the whole
/// image once another view reads more of the same frame. Thread-safe.
class NodeImageCache {
 public:
  /// Returns the image, or null before the first keep().
  std::shared_ptr<const NodeImage> image() const;
  /// Replaces the image, unless the present one contains as much.
  void keep(std::shared_ptr<const NodeImage> image) const;

 private:
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const NodeImage> image_;
};

/// Rectifies the samples of `rows` and decodes what they read. Each sample is independent of the
/// others in `rows`. Where several cameras replace the node, they are blended where its rays meet
/// `focal_plane` (focal plane reconstruction from the node's position). Requires `sources.count`
/// above 0.
std::shared_ptr<const NodeImage> make_node_image(const LightFieldFrame& instant, const Slab& slab,
                                                 int column, int row, const NodeSources& sources,
                                                 const Eigen::Vector4d& focal_plane,
                                                 const NodeRows& rows);

/// Returns the ResultCache key of the image: frames, weights, node and image plane; and the focal
/// plane where the node is not at a camera.
std::string node_image_key(const LightFieldFrame& instant, const Slab& slab, int column, int row,
                           const NodeSources& sources, const Eigen::Vector4d& focal_plane);

}  // namespace raystage::render
