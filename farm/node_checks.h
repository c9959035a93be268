// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "schemas/farm_job_document.h"

namespace raystage::farm {

/// Returns 16 hex digits that identify the renderer of this machine. They are a hash of the
/// executable raystage-render next to this program and of the versions of the shared libraries that
/// pixels depend on. Equal builds render equal frames at equal SIMD levels.
std::string build_id();

/// Returns why this node cannot run tasks of the job although other nodes may, or nothing if it
/// can. Reasons: a missing folder, an output folder that is not writable, an unreadable input, no
/// disk space for a frame, or another build. A job without a build (its tasks run in a container)
/// takes the build of the first node that is checked, stored in `folder`/build.
std::optional<std::string> node_fault(const schemas::FarmJobDocument& job,
                                      const std::filesystem::path& folder);

/// Returns why a file of `bytes` cannot be written to this folder and flushed, or nothing if it
/// can. Leaves no file behind.
std::optional<std::string> write_fault(const std::filesystem::path& folder, std::uintmax_t bytes);

}  // namespace raystage::farm
