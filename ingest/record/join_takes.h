// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

namespace raystage {

/// Makes one take of the parts that several nodes recorded of the same scene: every camera of every
/// part, its frames byte for byte, with their times moved to the earliest part's epoch. The nodes'
/// accounts are kept; each camera says which node recorded it. Every frame is held against its hash
/// on the way. The parts stay as they are. Cameras whose places were guessed (see
/// kUncalibratedRigName) are put in one row, and the joint rig counts as not calibrated then.
/// Throws Error: bad input where a camera id occurs twice, the parts differ in colour space or in
/// scale, lie further apart than a take can hold, the new take would lie within one of them, or a
/// frame is damaged; failed for the disk or when stopped.
///
/// `documents_only`: the archives stay where they are. The take gets take.json, rig.json, the
/// nodes' accounts and the cameras' journals, by their names in the parts; times count from the
/// joint epoch, and take.json says where an archive counts from another one. Parts need no archives
/// then. Frames are not held against their hashes.
struct JoinReport {
  int cameras = 0;
  std::uint64_t frames = 0, missing = 0, bytes = 0;
  std::vector<std::string> warnings;  ///< sentences without a full stop
};
JoinReport join_takes(const std::vector<std::filesystem::path>& parts,
                      const std::filesystem::path& take_folder, const std::string& created_by,
                      bool documents_only, const std::function<void(double)>& progress,
                      const std::stop_token& stop);

}  // namespace raystage
