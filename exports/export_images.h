// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stop_token>

#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "exports/image_format.h"
#include "store/take.h"

namespace raystage::exports {

struct ImageExportOptions {
  std::filesystem::path output;  ///< folder; must not exist
  /// With kConstant, files of one number belong to one tick; otherwise number n is the n-th
  /// recorded frame of a camera.
  FrameChoiceOptions frames;
  const ImageFormat* format = &image_format("jpeg");
  ExrExportOptions exr;
  ExportProgress progress = [](double) {};
};

/// Writes a folder of numbered files per camera (CAMERA/000001.jpg), frames.csv with the time of
/// each file, and rig.json. The folder appears when it is complete. Throws Error.
ExportReport export_images(const store::Take& take, const ImageExportOptions& options,
                           const std::stop_token& stop);

}  // namespace raystage::exports
