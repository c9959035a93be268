// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/attack/attack_scene.h"

namespace raystage::testing {

/// Writes bags, packed takes, takes of video and of deep pictures, depth maps, rigs of other
/// programs, and what else archives and exchange read, into the folder of write_attack_scene().
/// Throws std::runtime_error if a command fails.
void write_attack_archives(const std::filesystem::path& folder);

/// Returns the formats of write_attack_archives().
std::vector<AttackedFormat> attacked_archives(const std::filesystem::path& folder);

}  // namespace raystage::testing
