// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "schemas/import_manifest.h"
#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"

namespace raystage::ingest {

struct ImportOptions {
  /// For images that are not JPEG, with their restart_interval.
  store::JpegEncodeOptions encode{};
  /// Interval in MCUs of the restart markers that are added to JPEG input without a change of its
  /// coefficients (-1: default_restart_interval). Without a value JPEG is stored byte for byte.
  std::optional<int> restart_markers{};
  /// Whether images and movies of more than 8 bits keep them, as JPEG XL pictures; false: rounded
  /// to 8 bits, as JPEG.
  bool keep_depth = true;
  double distance = 0;       ///< of these pictures, see store::PictureCompression
  std::string created_by{};  ///< program and version, for take.json
  /// Called with the fraction done, in [0, 1], from any thread. May be empty.
  std::function<void(double)> progress{};
  bool is_valid(std::string* reason) const;
};

struct ImportSummary {
  int cameras = 0;
  std::int64_t frames = 0;
  std::int64_t copied = 0, rewritten = 0, encoded = 0;  ///< JPEG frames
  std::int64_t deep = 0;  ///< frames of more than 8 bits; with the above their sum is `frames`
  /// Samples of these that were infinite or not numbers: stored as the largest half float or 0.
  std::int64_t not_finite = 0;
  std::uint64_t jpeg_bytes = 0;  ///< of all stored frames
};

/// Returns the rig of the cameras of a manifest, with its name.
schemas::RigDocument rig_of(const schemas::ImportManifest& manifest);

/// Creates the take `take_folder` from the images and movies of `manifest`, whose paths are
/// relative to `base`. Imports the cameras in parallel in the current TBB arena, with one frame of
/// each camera in memory. Throws Error (bad input) if an image is missing, damaged or of the wrong
/// size, or if a movie's numbers of frames and times differ. Throws Error (failed) if the take
/// exists, on a disk error, or on a stop. No take is left behind after an error.
ImportSummary import_take(const schemas::ImportManifest& manifest,
                          const std::filesystem::path& base,
                          const std::filesystem::path& take_folder, const ImportOptions& options,
                          std::stop_token stop = {});

}  // namespace raystage::ingest
