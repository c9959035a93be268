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

namespace raystage {

/// What an instant's depths stand on.
struct DepthStoreKey {
  std::uint64_t set = 0;      ///< XXH3 over the algorithm's version, settings, colour space and rig
  std::uint64_t instant = 0;  ///< the same, and each camera's JPEG bytes or that it has none
  bool operator==(const DepthStoreKey&) const = default;
};
DepthStoreKey depth_store_key(const LightFieldFrame& instant,
                              const DepthEstimationSettings& settings);

/// Returns FOLDER/depth/SET/INSTANT.zst. `folder`: LightFieldFrame::derived_folder().
std::filesystem::path depth_file_path(const std::filesystem::path& folder,
                                      const DepthStoreKey& key);

/// The instant's depths: those kept in LightFieldFrame::derived_folder() if they are whole and fit,
/// else found anew and kept there. What hinders the keeping (a read-only take, a full disk) is no
/// error but told in `note`, for people. The first of a new set makes room: see prune_depth_sets().
CameraDepths load_or_estimate_camera_depths(const LightFieldFrame& instant,
                                            const DepthEstimationSettings& settings,
                                            std::size_t working_bytes, bool keep,
                                            std::string& note);

/// Stores the depths of an instant's cameras in depth_file_path(), as
/// load_or_estimate_camera_depths() does, unless they are there and whole.
StoreResult store_camera_depths(const LightFieldFrame& instant,
                                const DepthEstimationSettings& settings, std::size_t working_bytes);

/// Sets that a take keeps, and for how long one is left alone that somebody may be at.
inline constexpr std::size_t kMaxStoredDepthSets = 4;
inline constexpr std::chrono::hours kDepthSetUseTime{1};
/// For how long a pin keeps a set.
inline constexpr std::chrono::hours kMaxPinTime{30 * 24};

/// Keeps a set (the folder of a depth_file_path()) from prune_depth_sets() until it is unpinned or
/// kMaxPinTime has passed: a file `pin.JOB` in it. Creates the folder where it is missing, and
/// makes room as the first file of a new set does. Throws Error (bad input) where `job` is no file
/// name of 1 to 200 bytes, Error (failed) where the folder cannot be written.
void pin_depth_set(const std::filesystem::path& set, std::string_view job);
/// A missing pin, or one that cannot be removed, is no error.
void unpin_depth_set(const std::filesystem::path& set, std::string_view job);

/// Removes from `folder` (TAKE/depth) all sets but those used last, kMaxStoredDepthSets of them and
/// whatever was used within kDepthSetUseTime, or is pinned; files right in it likewise, as earlier
/// versions left them; and in the sets files that a process left half written, unless they changed
/// within kDepthSetUseTime. Other things stay. A process that has a removed file open reads on
/// undisturbed where disks are local; over NFS another host's may find it gone, and finds its
/// depths anew. What cannot be removed stays: never an error.
void prune_depth_sets(const std::filesystem::path& folder, std::filesystem::file_time_type now);

}  // namespace raystage
