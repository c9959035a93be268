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

namespace raystage {

/// Some rays and where they meet the scene, as the kernels read them: floats about the middle of
/// the rig, whatever the eye's distance. Each ray's line starts anew at its point nearest to there.
struct RayChunk {
  static constexpr int kSize = 64;
  int count = 0;
  alignas(64) std::array<std::array<float, kSize>, 3> base{}, direction{};
  alignas(64) std::array<float, kSize> eye{};  ///< metres from the base along the ray
  /// Of the point from the eye, per metre; 0: at infinity; not-a-number: none.
  alignas(64) std::array<float, kSize> inverse_distance{};
  /// (point from the base along the ray) * inverse_distance: 1 at infinity.
  alignas(64) std::array<float, kSize> point{};
};

/// At most kSize rays; `middle`: Rig::centre(). The rest of the chunk sees nothing. Inverse
/// distances are double up to here: seen from 1e6 m away, all of a scene lies within a millionth of
/// them.
void fill_chunk(std::span<const WorldRay> rays, std::span<const double> inverse_distance,
                const Eigen::Vector3d& middle, RayChunk& chunk);

/// A camera as the kernels read it.
struct ChunkCamera {
  int camera = 0;                            ///< of the rig
  SourceView lens;                           ///< ideal_from_pixel is not used
  std::array<float, 3> centre{};             ///< from the middle of the rig, metres
  std::array<float, 9> camera_from_world{};  ///< rotation, row-major
};

std::vector<ChunkCamera> chunk_cameras(const Rig& rig);

/// A camera's part in a chunk: by how much it counts for each ray, and where it sees the point.
struct ChunkWeights {
  alignas(64) std::array<float, RayChunk::kSize> weight;
  alignas(64) std::array<float, RayChunk::kSize> u, v;  ///< pixels; where seen is 0, anything
  alignas(64) std::array<float, RayChunk::kSize> seen;
};

/// RayWeightSettings in metres, for the kernels.
struct ChunkWeightSettings {
  int cameras = 4;
  float angular = 1, resolution = 0, field_of_view = 0, border = 0, least = 0;

  ChunkWeightSettings(const RayWeightSettings& weighing, double spacing);
};

// The kernels. Run-time dispatch, no allocation; lengths and orders of `cameras` and `weights` are
// those of each other.

/// compute_camera_weights_reference() for a chunk: fills all of `weights`, whose sum over the
/// cameras is, per ray, the largest `seen` of a camera: 0 where none sees the point.
void compute_camera_weights(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                            const ChunkWeightSettings& weighing, std::span<ChunkWeights> weights);

/// With weights given (of any scale, 0 or more) instead of worked out: fills u, v and seen, and
/// brings the weights to the same sum.
void apply_given_weights(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                         std::span<ChunkWeights> weights);

/// Per ray, of the cameras that have a weight: how many of equal weight would be as many
/// (effective_cameras()), and how near the nearest of their centres is to the ray's line, metres;
/// 0 and infinity where there are none. Aligned, kSize each.
void measure_effective_cameras(const RayChunk& chunk, std::span<const ChunkCamera* const> cameras,
                               std::span<const ChunkWeights> weights, float* effective,
                               float* nearest);

/// Whether a camera has a weight for any of the rays.
bool counts(const ChunkWeights& weights, int count);

/// The cameras' samples, bilinear, by their weights: premultiplied linear light (R, G, B, A; code
/// 65535 being `full_scale`) of `count` rays. Cameras without a frame (SourceView::rgba) count for
/// nothing. `sums`: as blend_run().
void blend_chunk(std::span<const ChunkCamera* const> cameras, std::span<const ChunkWeights> weights,
                 int count, BlendSpace space, float full_scale, float* rgba,
                 SumStage sums = SumStage::kSampleAndFinish);

/// Marks in the lens's wanted_mcus all that blend_chunk() will read, and in its read_pixels, if
/// there are any, exactly that. Many threads may mark the same bytes.
void mark_needed_mcus(const SourceView& lens, const ChunkWeights& weights, int count);

}  // namespace raystage
