// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace raystage::farm {

/// JOB/fingerprints: what each frame's file must be made from, as the task says that renders it.
/// Where archives are on several nodes no other process knows. A file for each task, with lines
/// "FRAME FINGERPRINT" as `raystage render --fingerprints` writes them.
std::filesystem::path fingerprints_file(const std::filesystem::path& job_folder, int task);

/// All that tasks have written so far, by frame. Lines that are damaged are left out.
std::map<int, std::string> read_fingerprints(const std::filesystem::path& job_folder);

}  // namespace raystage::farm
