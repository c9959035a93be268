// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <stop_token>

#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "render/depth/recorded_depths.h"
#include "schemas/geometry.h"
#include "store/take.h"

namespace raystage::exports {

struct DepthExportOptions {
  std::filesystem::path output;  ///< folder; must not exist
  FrameChoiceOptions frames;     ///< its times are those of the timeline's ticks
  render::DepthQuantity quantity = render::DepthQuantity::kPlanar;
  /// Of 16-bit PNG files, as depths::DepthEncoding::inverse_range; none: EXR files with metres.
  std::optional<schemas::DepthRange> png_range;
  bool stores_depths = true;                         ///< estimated depths may be stored in the take
  std::size_t working_bytes = std::size_t{1} << 30;  ///< of the estimation
  ExportProgress progress = [](double) {};
};

/// Writes the depths of the recorded pictures, with their lens distortion, as CAMERA/000001.exr
/// (channel Z, float, 0: unknown) or .png; number n is tick n - 1. Depths are those that the method
/// `depth` uses by default: imported maps as they are, at their size, others estimated or read from
/// the take. The folder appears when it is complete. Throws Error as export_images(), and Error
/// (bad input) if the take has no depth range.
ExportReport export_depths(const store::Take& take, const DepthExportOptions& options,
                           const std::stop_token& stop);

}  // namespace raystage::exports
