// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"
#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage::testing {

/// The kernels' results for one pixel's ray, derived from what they rendered.
struct ProbedPixel {
  int x = 0, y = 0;               ///< of the view
  int cell = 0;                   ///< index into RayCells::cells()
  std::array<float, 3> weight{};  ///< of the cell's cameras, whatever they see; unused ones 0
  std::array<float, 3> seen{};    ///< visibility of the point in each camera, 0 to 1
  std::array<float, 3> u{}, v{};  ///< position in the camera's image, pixels, if seen fully
  float z = 0;  ///< planar depth, metres; infinity if the first camera sees nothing
};

/// Probes the view's pixels that cross a cell. The rig's images are at most 1024 pixels wide and
/// high. The kernels are a black box: blend_run() first renders pictures of the coordinates
/// themselves. Then it renders cameras of one primary colour each that see everything; their
/// mixture gives the weights.
std::vector<ProbedPixel> probe_kernels(const render::VirtualCamera& view, const rig::Rig& rig,
                                       const render::RayCells& cells,
                                       const render::PlaneProjection& projection);

}  // namespace raystage::testing
