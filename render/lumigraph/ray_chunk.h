// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/common/world_ray.h"
#include "render/lumigraph/ray_weights.h"
#include "render/sampling/source_view.h"
#include "rig/rig.h"

namespace raystage::render {

/// Rays and the points at which they meet the scene, for the kernels: floats relative to the centre
/// of the rig, whatever the eye's distance. A ray's base is its point nearest to the centre.
struct RayChunk {
  static constexpr int kSize = 64;
  int count = 0;
  alignas(64) std::array<std::array<float, kSize>, 3> base{}, direction{};
  alignas(64) std::array<float, kSize> eye{};  ///< metres from the base along the ray
  /// 1 / distance from eye to point, 1/m; 0: at infinity; NaN: no point.
  alignas(64) std::array<float, kSize> inverse_distance{};
  /// (point from the base along the ray) * inverse_distance: 1 at infinity.
  alignas(64) std::array<float, kSize> point{};
};

/// Fills a chunk with at most kSize rays; the other rays see nothing. `middle`: Rig::centre().
/// Inverse distances are double up to here, because from 1e6 m away those of a scene differ by a
/// millionth.
void fill_chunk(std::span<const WorldRay> rays, std::span<const double> inverse_distance,
                const Eigen::Vector3d& middle, RayChunk& chunk);

/// A camera in the kernels' coordinates.
struct ChunkCamera {
  int camera = 0;                            ///< of the rig
  SourceView lens;                           ///< ideal_from_pixel is not used
  std::array<float, 3> centre{};             ///< from the centre of the rig, metres
  std::array<float, 9> camera_from_world{};  ///< rotation, row-major
};

std::vector<ChunkCamera> chunk_cameras(const rig::Rig& rig);

/// A camera's weight for each ray of a chunk, and where it sees the point.
struct ChunkWeights {
  alignas(64) std::array<float, RayChunk::kSize> weight;
  alignas(64) std::array<float, RayChunk::kSize> u, v;  ///< pixels; undefined if seen is 0
  alignas(64) std::array<float, RayChunk::kSize> seen;
};

/// RayWeightOptions in metres, for the kernels.
struct ChunkWeightOptions {
  int cameras = 4;
  float angular = 1, resolution = 0, field_of_view = 0, border = 0, least = 0;

  ChunkWeightOptions(const RayWeightOptions& weighing, double spacing);
};

// The kernels. Run-time dispatch, no allocation; `cameras` and `weights` have the same length and
// order.

/// Computes what compute_camera_weights_reference() computes, for all rays: fills all of `weights`.
/// Per ray, their sum over the cameras is the largest `seen` of a camera: 0 if none sees the point.
void compute_camera_weights(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                            const ChunkWeightOptions& weighing, std::span<ChunkWeights> weights);

/// Fills u, v and seen for given weights (not negative), and scales the weights to the same sum.
void apply_given_weights(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                         std::span<ChunkWeights> weights);

/// Measures, per ray, the cameras that have a weight: their effective number (effective_cameras()),
/// and the smallest distance of their centres from the ray's line, metres. These are 0 and infinity
/// if there are none. Arrays are aligned, of kSize.
void measure_effective_cameras(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                               std::span<const ChunkWeights> weights, float* effective,
                               float* nearest);

/// Returns whether a camera has a weight for any of the rays.
bool has_weight(const ChunkWeights& weights, int count);

/// Blends the cameras' bilinear samples of `count` rays by their weights to premultiplied linear
/// light: R, G, B, A, with code 65535 = `full_scale`. Skips cameras without SourceView::rgba.
/// `sums`: as blend_run().
void blend_chunk(std::span<const ChunkCamera* const> cameras, std::span<const ChunkWeights> weights,
                 int count, store::BlendSpace space, float full_scale, float* rgba,
                 SumStage sums = SumStage::kSampleAndFinish);

/// Marks in the lens's wanted_mcus all MCUs that blend_chunk() will read, and in its read_pixels,
/// if set, exactly those pixels. Thread-safe: threads may mark the same bytes.
void mark_needed_mcus(const SourceView& lens, const ChunkWeights& weights, int count);

}  // namespace raystage::render
