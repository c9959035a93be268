// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"
#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage::testing {

/// What the kernels made of one pixel's ray, read back from what they rendered.
struct ProbedPixel {
  int x = 0, y = 0;               ///< of the view
  int cell = 0;                   ///< index into RayCells::cells()
  std::array<float, 3> weight{};  ///< of the cell's cameras, wherever they look; unused ones 0
  std::array<float, 3> seen{};    ///< how far each camera sees the point, 0 to 1
  std::array<float, 3> u{}, v{};  ///< where, in pixels of its image, if it does fully
  float z = 0;                    ///< planar depth, metres; infinity where the first sees nothing
};

/// Probes the view's pixels that pass some cell. The rig's images are at most 1024 pixels wide and
/// high. Black box: blend_run() renders pictures of the coordinates themselves, then cameras of one
/// primary colour each that see everywhere, whose mixture is the weights.
std::vector<ProbedPixel> probe_kernels(const VirtualCamera& view, const Rig& rig,
                                       const RayCells& cells, const PlaneProjection& projection);

}  // namespace raystage::testing
