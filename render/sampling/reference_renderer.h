// SPDX-License-Identifier: Apache-2.0
// The common parts of the per-ray references: whole frames, rays in double with CameraModel, loops,
// statistics. Each reference adds only its formula.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "render/common/method.h"
#include "render/common/ray_coverage.h"
#include "rig/camera_model.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::render {

struct FrameSample {
  std::array<double, 3> rgb{};  ///< on the scale of the blend space, full scale 1, times alpha
  double alpha = 1;             ///< alpha of the frame
};

/// The frames of one light field frame, decoded whole.
class ReferenceFrames {
 public:
  /// Adds the decoded pixels and the cameras to `statistics`. Throws Error (bad input) for a frame
  /// that cannot be read.
  ReferenceFrames(const LightFieldFrame& instant, bool count_needed_pixels,
                  RenderStatistics& statistics);

  const std::vector<int>& present() const { return present_; }
  bool has(std::size_t camera) const { return frames_[camera] != nullptr; }
  const store::DecodedFrame& frame(std::size_t camera) const { return *frames_[camera]; }

  /// Samples bilinearly; pixel centres lie at +0.5. Thread-safe.
  FrameSample sample(std::size_t camera, const Eigen::Vector2d& pixel);

  /// Returns the distinct pixels that were sampled with a weight; 0 unless counted.
  std::int64_t pixels_needed() const;

 private:
  std::vector<int> present_;
  std::vector<std::shared_ptr<const store::DecodedFrame>> frames_;
  std::vector<std::vector<std::uint8_t>> read_;  ///< per camera and pixel; empty: not counted
};

/// Returns premultiplied linear light, R, G, B, A, of a colour in the blend space.
std::array<float, 4> premultiplied_light(const std::array<double, 3>& color, double alpha,
                                         const store::FrameCache& cache);

/// The ray through the centre of a pixel of the view.
struct ReferenceRay {
  int x = 0, y = 0;
  Eigen::Vector3d direction;    ///< world; -1 along the view's z axis
  Eigen::Vector2d ideal_pixel;  ///< its pixel in the view without lens distortion
};

/// The result of a ray; initially unseen.
struct ReferencePixel {
  std::array<float, 4> rgba{};
  float coverage = 0;
  float z = std::numeric_limits<float>::infinity();
  float cameras = 0;                                           ///< as RenderedView
  float nearest_ray = std::numeric_limits<float>::infinity();  ///< as RenderedView
  float empty_space = 0;                                       ///< as RenderedView
};
using ReconstructRay = std::function<void(const ReferenceRay& ray, ReferencePixel& pixel)>;

/// Renders a view ray by ray, with or without lens distortion.
class ReferenceRenderer {
 public:
  /// Decodes all frames. Keeps a reference to `request`.
  explicit ReferenceRenderer(const ViewRequest& request);

  ReferenceFrames& frames() { return frames_; }

  /// Calls `reconstruct` for every pixel that has a ray, from many threads.
  RenderedView render(const ReconstructRay& reconstruct) const;

 private:
  const ViewRequest& request_;
  RenderStatistics statistics_;
  ReferenceFrames frames_;
};

}  // namespace raystage::render
