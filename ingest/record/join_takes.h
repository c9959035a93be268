// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"

namespace raystage::ingest {

/// The result of join_takes().
struct JoinReport {
  RunStatus status = RunStatus::kNotRun;
  int cameras = 0;
  std::uint64_t frames = 0, missing = 0, bytes = 0;
  std::vector<std::string> warnings;  ///< sentences without a full stop
};

/// Joins the parts that several nodes recorded of the same scene into one take: all cameras, frames
/// byte for byte, times relative to the earliest part's epoch. The session documents of the nodes
/// are copied, and each camera names its node. Every frame is compared with its hash. The parts are
/// not changed. Cameras with default poses (kUncalibratedRigName) are placed in one row; the joined
/// rig then counts as not calibrated.
///
/// `documents_only`: the archives are not copied, not compared with hashes and need not exist. The
/// take gets take.json, rig.json, the session documents, and the journals under their names in the
/// parts. The joined take.json gives the epoch of each archive that differs from the joined epoch.
///
/// Throws Error (bad input) if a camera id occurs twice, or the parts differ in colour space or
/// scale. The same applies if a part ends after the longest time of a take, the new take is inside
/// a part, or a frame is damaged. Throws Error (failed) on a disk error or a stop.
JoinReport join_takes(const std::vector<std::filesystem::path>& parts,
                      const std::filesystem::path& take_folder, const std::string& created_by,
                      bool documents_only, const std::function<void(double)>& progress,
                      const std::stop_token& stop);

}  // namespace raystage::ingest
