// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "render/common/method.h"
#include "render/depth/camera_depths.h"

namespace raystage::render {

/// Hashes of the inputs of an instant's depths.
struct DepthStoreKey {
  std::uint64_t set = 0;      ///< XXH3 over the algorithm's version, settings, colour space and rig
  std::uint64_t instant = 0;  ///< `set`, and each camera's JPEG bytes or their absence
  std::uint64_t regions = 0;  ///< `instant` and DepthEstimationOptions::regions; 0: all of all
  bool operator==(const DepthStoreKey&) const = default;
};
/// Returns the key of an instant's depths; reads the JPEG bytes of all its frames.
DepthStoreKey depth_store_key(const LightFieldFrame& instant,
                              const DepthEstimationOptions& options);

/// Returns FOLDER/depth/SET/INSTANT.zst, or INSTANT.REGIONS.zst. `folder`:
/// LightFieldFrame::derived_folder().
std::filesystem::path depth_file_path(const std::filesystem::path& folder,
                                      const DepthStoreKey& key);

/// Returns the depths of an instant's cameras. They are read from LightFieldFrame::derived_folder()
/// if the file is intact and its key equal, else estimated and, if `stores_depths`, stored there.
/// If they cannot be stored (a read-only take, a full disk), `note` says why; this is not an error.
/// The first file of a new set calls prune_depth_sets().
CameraDepths load_or_estimate_camera_depths(const LightFieldFrame& instant,
                                            const DepthEstimationOptions& options,
                                            std::size_t working_bytes, bool stores_depths,
                                            std::string& note);

/// Stores the depths of an instant's cameras in depth_file_path(), as
/// load_or_estimate_camera_depths() does, unless an intact file is there.
StoreResult store_camera_depths(const LightFieldFrame& instant,
                                const DepthEstimationOptions& options, std::size_t working_bytes);

/// The number of stored sets per take, and the time after its last use in which a set is kept.
inline constexpr std::size_t kMaxStoredDepthSets = 4;
inline constexpr std::chrono::hours kDepthSetUseTime{1};
/// The time after which a pin has no effect.
inline constexpr std::chrono::hours kMaxPinTime{30 * 24};

/// Protects a set (the folder of a depth_file_path()) from prune_depth_sets() by a file `pin.JOB`
/// in it, until it is unpinned or kMaxPinTime has passed. Creates a missing folder and then prunes
/// as the first file of a new set does. Throws Error (bad input) if `job` is not a file name of 1
/// to 200 bytes, Error (failed) if the folder cannot be written.
void pin_depth_set(const std::filesystem::path& set, std::string_view job);
/// Removes a pin. It is not an error if the pin is missing or cannot be removed.
void unpin_depth_set(const std::filesystem::path& set, std::string_view job);

/// The number of files INSTANT.REGIONS.zst that are kept of each light field frame.
inline constexpr std::size_t kMaxStoredRegions = 4;
/// Removes those of a set beyond kMaxStoredRegions, the last used stay; unless they were used
/// within kDepthSetUseTime or the set has a pin. Called now and then as such files are stored.
void prune_depth_regions(const std::filesystem::path& set, std::filesystem::file_time_type now);

/// Removes sets from `folder` (TAKE/depth), except the kMaxStoredDepthSets last used, those used
/// within kDepthSetUseTime, and pinned ones. Also removes depth files directly in the folder (of
/// earlier versions) and unfinished files in sets, if they are older than kDepthSetUseTime. Other
/// files stay. On a local disk, a process that has a removed file open can read on; over NFS it may
/// lose the file and estimates the depths again. Files that cannot be removed stay: never an error.
void prune_depth_sets(const std::filesystem::path& folder, std::filesystem::file_time_type now);

}  // namespace raystage::render
