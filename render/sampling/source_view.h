// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstdint>

#include "render/common/contribution.h"
#include "render/sampling/fisheye_fit.h"
#include "rig/camera_model.h"
#include "store/processing/frames/blend_space.h"

namespace raystage::render {

/// A source camera for the sampling kernels: maps a pixel of the view to weighted pixels of the
/// camera's frame. Contains plain numbers and owns nothing.
struct SourceView {
  /// (X, Y, W) = ideal_from_pixel * (x, y, 1), row-major; ideal image point (X/W, Y/W), W > 0.
  std::array<double, 9> ideal_from_pixel{};
  float fx = 1, fy = 1, cx = 0, cy = 0;  ///< pixels
  float k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
  float fold_radius_squared = 0;  ///< limit of the lens model; infinity without one
  bool distorted = false;         ///< also of a fisheye
  bool is_fisheye = false;        ///< `fisheye` counts; rays may come from behind, W <= 0
  FisheyeFit fisheye;
  int width = 0, height = 0;  ///< pixels

  /// For blending: R, G, B, A per pixel, rows without padding between them (DecodedFrame);
  /// null for a camera that contributes to no pixel.
  const std::uint16_t* rgba = nullptr;

  /// For planning: one byte per MCU of the frame, set to 1 where a sample reads it; null where the
  /// whole frame is decoded anyway.
  std::uint8_t* wanted_mcus = nullptr;
  int mcus_per_row = 0;
  int mcu_width_log2 = 3, mcu_height_log2 = 3;
  /// Radius in pixels around a sample's own pixels from which its chroma is made: 0 or 1.
  int chroma_radius = 0;
  /// For counting: one byte per pixel, set to 1 where a sample reads it with a weight; or null.
  std::uint8_t* read_pixels = nullptr;
};

/// Marks an MCU as wanted; thread-safe. Reads first, because nearly all are already marked and a
/// write would take the cache line from other threads.
inline void mark_mcu(std::uint8_t* wanted_mcus, int mcu) {
  const std::atomic_ref wanted(wanted_mcus[mcu]);
  if (wanted.load(std::memory_order_relaxed) == 0) wanted.store(1, std::memory_order_relaxed);
}

/// Returns the geometry of a source camera; frame pointer and masks are left unset.
/// `ideal_from_pixel`: maps (x, y, 1) of the view to (X, Y, W), see SourceView.
SourceView make_source_view(const rig::CameraModel& camera,
                            const Eigen::Matrix3d& ideal_from_pixel);

/// A run of pixels of one row of the view whose rays pass between the same cameras.
struct PixelRun {
  int begin = 0, end = 0, y = 0;
  int room_end = 0;  ///< if beyond `end`: blend_run may write into pixels up to here (vectors do)
  int count = 0;     ///< source cameras: 1 to 3
  std::array<SourceView*, 3> source{};
  /// Numerators of the weights as linear functions of the pixel position (RayCells::Cell::share).
  std::array<std::array<double, 3>, 3> share{};
  std::array<double, 3> total{};  ///< sum of the numerators; only its sign matters
  std::array<double, 3> slope{};  ///< of the focal plane (PlaneProjection)
  double distance = 0;
  bool at_infinity = false;
  bool nearest_only = false;              ///< only the camera nearest to the ray counts
  std::array<double, 3> edge_products{};  ///< RayCells::Cell::edge_products, for nearest_only
};

/// The visibility falls continuously to 0 within the outermost half pixel of a frame and within the
/// last hundredth before the limit of the lens model.
inline constexpr float kBorderFade = 2.0F;  // per pixel
inline constexpr float kFoldFade = 100.0F;  // per fold radius squared

/// Marks what blend_run() will read, tap by tap; many threads may mark the same bytes. Run-time
/// dispatch: see kernel_target().
void mark_run(const PixelRun& run);

/// Reconstructs the run into rows of the view, starting at its first pixel. `rgba`: 4 floats per
/// pixel (premultiplied linear light, code 65535 is `full_scale`). `alpha`: 1 float (equal to A).
/// `z`: 1 float (+infinity where A is 0). `sums`: kSampleOnly writes only `rgba`, and nothing
/// beyond the run; kFinishOnly reads `rgba` first.
void blend_run(const PixelRun& run, store::BlendSpace space, float full_scale, float* rgba,
               float* alpha, float* z, SumStage sums = SumStage::kSampleAndFinish);

/// Writes the run's rounded sums of weighted codes on the scale of the blend space: R, G, B, A per
/// pixel, A = 65535 where all cameras see the ray. Rays that do not meet the plane give 0.
void blend_run_codes(const PixelRun& run, std::uint16_t* rgba);

/// Returns the name of the instruction set in use, e.g. "AVX3".
const char* kernel_target();

}  // namespace raystage::render
