// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "depths/depth_encoding.h"
#include "store/take.h"

namespace raystage::depths {

/// What the numbers of imported files count, from 1.
enum class MapNumbers {
  kTicks,    ///< ticks of the take's timeline, as the frames of shots
  kRecorded  ///< the frames that a camera recorded
};

struct DepthImportOptions {
  DepthEncoding encoding;
  MapNumbers numbers = MapNumbers::kTicks;
  bool overwrites = false;                               ///< replace maps that were imported before
  std::string created_by;                                ///< program and version
  std::function<void(double)> progress = [](double) {};  ///< 0 to 1, from any thread
};

struct DepthImportReport {
  std::size_t maps = 0, replaced = 0;
  int cameras = 0;           ///< that maps were imported for
  double unknown_share = 0;  ///< of all pixels
  /// Pixels that became unknown, because others would be stored too coarsely (map_checks.h).
  std::size_t too_near = 0;
  std::vector<std::string> notes;
};

/// Stores depth images in a take (docs/formats/depth.md). `folder`: CAMERA/000001.exr or .png, or
/// CAMERA.exr or .png if the take has one light field frame. The maps cover the whole recorded
/// pictures, with their lens distortion, at any resolution. The list of maps is written last and
/// atomically: after an error the take has the maps that it had before. Files of maps that the list
/// does not name, such as those of a killed import, are removed then. Throws Error (bad input)
/// for unknown cameras, numbers beyond the take, maps of another shape than the pictures or with a
/// side below 8 pixels or a sixteenth of theirs, maps that exist unless `overwrites`, and files
/// that cannot be read; Error (failed) if it was stopped, or if another import into the take is
/// running.
DepthImportReport import_depths(const store::Take& take, const std::filesystem::path& folder,
                                const DepthImportOptions& options, const std::stop_token& stop);

}  // namespace raystage::depths
