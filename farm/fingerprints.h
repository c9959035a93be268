// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace raystage::farm {

/// Returns the file in JOB/fingerprints with the fingerprints of the frames that a task renders.
/// With distributed archives only that task can compute them. Each line is "FRAME FINGERPRINT", as
/// the fingerprints file of `raystage render`.
std::filesystem::path fingerprints_file(const std::filesystem::path& job_folder, int task);

/// Returns the fingerprints that tasks have written so far, by frame. Skips damaged lines.
std::map<int, std::string> read_fingerprints(const std::filesystem::path& job_folder);

}  // namespace raystage::farm
