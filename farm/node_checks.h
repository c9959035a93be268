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
/// is not there, an output folder that cannot be written to, an input that cannot be read, no room
/// for a frame, another build. None: nothing. A job without a build (its tasks run in a container)
/// gets that of the first node that is asked: `folder`/build.
std::optional<std::string> node_fault(const FarmJobDocument& job,
                                      const std::filesystem::path& folder);

/// Whether a file of `bytes` could be written to this folder and flushed; the reason why not, else
/// none. Leaves nothing.
std::optional<std::string> write_fault(const std::filesystem::path& folder, std::uintmax_t bytes);

}  // namespace raystage::farm
