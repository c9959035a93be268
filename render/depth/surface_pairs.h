// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>

#include "render/depth/blend_kernels.h"
#include "render/depth/depth.h"

namespace raystage::render::depth {

/// Inverse depths, 1/m, of two surfaces that a pixel at an edge of depth shows.
struct SurfacePair {
  float front = 0, behind = 0;
};

/// Returns the surfaces of a pixel of the view's depths: its own depth, and the nearest of its
/// neighbours' in front of it, or else the farthest one behind it. None if no depth of the eight
/// neighbours is further away than `separation` (1/m, above 0).
std::optional<SurfacePair> surface_pair(const InverseDepthMap& view_depths, int x, int y,
                                        float separation);
/// Returns the distance of surfaces that the plan's views tell apart; none if it keeps each pixel
/// to one surface. Views with several samples a pixel do: their mean is soft.
std::optional<float> surface_separation(const DepthViewPlan& plan, const ViewRequest& request);

/// The surfaces of a run of pixels.
struct SurfaceRun {
  std::array<float, kMaxRunPixels> front{};   ///< where there is one surface: its depth
  std::array<float, kMaxRunPixels> behind{};  ///< where there is one: its depth, too
  std::array<bool, kMaxRunPixels> is_pair{};
  int begin = 0, end = 0;  ///< all pairs are in [begin, end)

  bool has_pairs() const { return begin < end; }
};
/// Returns the surfaces of `count` pixels of row y from x on. `separation`: as above; none: no
/// pairs.
SurfaceRun surfaces_of_run(const InverseDepthMap& view_depths, int x, int y, int count,
                           std::optional<float> separation);

/// Sums over the cameras of a pixel at its front surface. The share of the pixel that the surface
/// covers is at / visible.
struct FrontShare {
  float visible = 0;  ///< weights of the cameras from which nothing hides it
  float at = 0;       ///< of these, the part whose own depths are there
};

/// A pixel of two surfaces.
struct CombinedSurfaces {
  std::array<float, 4> rgba{};
  float inverse_depth = 0;        ///< of the first surface at which half of A is reached
  std::optional<EdgePixel> edge;  ///< none: only one of the surfaces is seen
};
/// Puts two surfaces together. `front`, `behind`: their premultiplied colours as finish_samples()
/// returns them, those of the front by the cameras whose own depths are there (FrontShare::at). The
/// front covers as much more than its share as what is behind is transparent. It is left out where
/// next to no camera has it.
CombinedSurfaces combine_surfaces(const SurfacePair& pair, const FrontShare& share,
                                  std::span<const float, 4> front,
                                  std::span<const float, 4> behind);

}  // namespace raystage::render::depth
