// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "render/depth/camera_depths.h"

namespace raystage {

/// What an instant's depths stand on.
struct DepthKey {
  std::uint64_t set = 0;      ///< XXH3 over the algorithm's version, settings, colour space and rig
  std::uint64_t instant = 0;  ///< the same, and each camera's JPEG bytes or that it has none
  bool operator==(const DepthKey&) const = default;
};
DepthKey depth_key(const Instant& instant, const DepthSettings& settings);

/// Where a take keeps them: TAKE/depth/SET/INSTANT.zst.
std::filesystem::path depth_file(const std::filesystem::path& take_folder, const DepthKey& key);

/// The instant's depths: those kept in the take's folder if they are whole and fit, else found anew
/// and kept there. What hinders the keeping (a read-only take, a full disk) is no error but told in
/// `note`, for people. The first of a new set makes room: see remove_old_depth_sets().
CameraDepths kept_camera_depths(const Instant& instant, const DepthSettings& settings,
                                std::size_t working_bytes, bool keep, std::string& note);

/// Sets that a take keeps, and for how long one is left alone that somebody may be at.
inline constexpr std::size_t kKeptDepthSets = 4;
inline constexpr std::chrono::hours kDepthsInUse{1};

/// Removes from `folder` (TAKE/depth) all sets but those used last, kKeptDepthSets of them and
/// whatever was used within kDepthsInUse; files right in it likewise, as earlier versions left
/// them; and in the sets files that a process left half written, unless they changed within
/// kDepthsInUse. Other things stay. A process that has a removed file open reads on undisturbed
/// where disks are local; over NFS another host's may find it gone, and finds its depths anew. What
/// cannot be removed stays: never an error.
void remove_old_depth_sets(const std::filesystem::path& folder,
                           std::filesystem::file_time_type now);

}  // namespace raystage
