// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "schemas/import_manifest.h"
#include "store/jpeg/encode.h"

namespace raystage {

struct ImportSettings {
  /// For images that are no JPEG; its restart_interval too.
  JpegEncodeSettings encode{};
  /// JPEG input is rewritten with restart markers every so many MCUs (-1: by
  /// default_restart_interval), coefficients untouched. Nothing: it is stored byte for byte.
  std::optional<int> restart_markers{};
  std::string created_by{};  ///< program and version, for take.json
  /// Called with the share done, in [0, 1], from any thread. May be empty.
  std::function<void(double)> progress{};
};

struct ImportSummary {
  int cameras = 0;
  std::int64_t frames = 0;
  std::int64_t copied = 0, rewritten = 0, encoded = 0;  ///< frames; together `frames`
  std::uint64_t jpeg_bytes = 0;                         ///< of all frames stored
};

/// Creates the take `take_folder` from the images and movies of the manifest; their paths are
/// relative to `base`. Reads the cameras in parallel in the current TBB arena, with one frame of
/// each camera in memory. Throws Error (bad input) for a missing, damaged or wrongly sized image,
/// and for a movie whose number of frames differs from its number of times. Throws Error (failed)
/// for an existing take, a disk error, or a stop. No take is left behind after an error.
ImportSummary import_take(const ImportManifest& manifest, const std::filesystem::path& base,
                          const std::filesystem::path& take_folder, const ImportSettings& settings,
                          std::stop_token stop = {});

}  // namespace raystage
