// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

/// Identifies what renders on this machine: a hash of the executable raystage-render next to this
/// program and of the versions of the shared libraries that pixels depend on. Equal builds
/// give equal frames at equal SIMD levels. 16 hex digits.
std::string build_id();

/// What keeps this node from carrying out tasks of the job, although other nodes may: a folder that
/// is not there, an output folder that cannot be written to, no room for a frame, another build.
/// None: nothing.
std::optional<std::string> node_fault(const FarmJobDocument& job);

/// Whether a file of `bytes` could be written to this folder and flushed; the reason why not, else
/// none. Leaves nothing.
std::optional<std::string> write_fault(const std::filesystem::path& folder, std::uintmax_t bytes);

}  // namespace raystage::farm
