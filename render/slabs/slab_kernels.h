// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "render/common/contribution.h"
#include "store/processing/frames/blend_space.h"

namespace raystage::render {

/// Selects the samples of a slab from which a ray is interpolated.
enum class SlabInterpolation {
  kQuadrilinear,   ///< four nodes, four samples of each: 16
  kBilinearNodes,  ///< four nodes, the nearest sample of each: 4
  kNearest         ///< the nearest sample of the nearest node
};

/// A run of pixels of one row of the view whose rays cross one cell of a slab's camera plane.
/// Functions are linear in the pixel: f[0] x + f[1] y + f[2].
struct SlabRun {
  using LinearFunction = std::array<double, 3>;
  int begin = 0, end = 0, y = 0;
  SlabInterpolation interpolation = SlabInterpolation::kQuadrilinear;
  /// Images of the nodes at the cell's upper left, upper right, lower left and lower right
  /// (NodeImage::rgba); null for nodes that see nothing or do not exist.
  std::array<const std::uint16_t*, 4> node{};
  int width = 0, height = 0;  ///< samples of each
  /// Position between the left and right nodes: column / across; between the upper and lower: row /
  /// across; both in [0, 1].
  LinearFunction column{}, row{}, across{};
  /// Where the nodes see the point of the focal plane, in samples: u / ahead for the left and right
  /// nodes, v / ahead for the upper and lower. The point is visible where `ahead` is above 0.
  std::array<LinearFunction, 2> u{}, v{};
  LinearFunction ahead{};
  /// The focal plane as seen from the view (PlaneProjection).
  LinearFunction slope{};
  double distance = 0;
  bool at_infinity = false;
};

/// Reconstructs the run into rows of the view, starting at its first pixel. `rgba`: 4 floats per
/// pixel (premultiplied linear light, code 65535 is `full_scale`). `z`: 1 float (+infinity where
/// alpha is 0). Run-time dispatch: see slab_kernel_target(). `sums`: as blend_run(); kSampleOnly
/// does not write `z`.
void sample_slab_run(const SlabRun& run, store::BlendSpace space, float full_scale, float* rgba,
                     float* z, SumStage sums = SumStage::kSampleAndFinish);

/// Returns the name of the instruction set in use, e.g. "AVX3".
const char* slab_kernel_target();

}  // namespace raystage::render
