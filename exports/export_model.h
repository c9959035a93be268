// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "exports/export_report.h"
#include "ingest/rig_formats/rig_format.h"
#include "store/take.h"

namespace raystage::exports {

struct ModelExportOptions {
  std::filesystem::path output;  ///< folder; must not exist
  /// Formats of the cameras, each with a folder of its files: see model_folder().
  std::vector<const ingest::RigFormat*> formats;
  std::vector<std::string> cameras = {};  ///< ids; empty: all
  /// Frame: tick + 1 of the timeline; none: the first one that most of the cameras have.
  std::optional<int> frame = {};
  /// Makes all images those of pinholes without distortion, as some trainers need.
  bool undistorts = false;
  ExportProgress progress = [](double) {};
};

/// The formats of models that name a picture per camera, below the folder of the export.
struct ModelFormat {
  const ingest::RigFormat* format;
  std::filesystem::path folder;  ///< of its files, relative to the export
};
/// Returns COLMAP ("sparse/0") and NeRF (""); both name the pictures in "images".
std::vector<ModelFormat> model_formats();

/// Writes a still light field: cameras for COLMAP and NeRF, and images/CAMERA.jpg. Images are the
/// frames byte for byte where all formats hold the camera's lens. Otherwise, they are resampled to
/// a fisheye without distortion of the same focal length and size, and encoded as JPEG of
/// quality 98. Cameras without a frame are left out. The folder appears when it is complete. Throws
/// Error.
ExportReport export_model(const store::Take& take, const ModelExportOptions& options,
                          const std::stop_token& stop);

}  // namespace raystage::exports
