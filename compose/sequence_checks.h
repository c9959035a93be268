// SPDX-License-Identifier: Apache-2.0
// Inside compose/ only: what would keep a sequence from being written, found before the first
// frame. All throw Error (bad input), or failed for the disk.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

#include "compose/sequence.h"
#include "compose/sequence_name.h"

namespace raystage {

/// Makes the folder and writes into it once.
void check_folder(const std::filesystem::path& folder);
/// Says so where the disk might not do.
void check_room(const std::filesystem::path& folder, const ShotPlan& plan, std::size_t frames,
                const SequenceOptions& options);
void check_existing(const SequenceName& name, std::span<const int> frames);
/// What a shot shows it must not write, not even in chunks.
void check_plates(const ShotPlan& plan, const SequenceName& name,
                  const std::filesystem::path& shot_file);
SequenceName checked_name(const SequenceOptions& options, std::size_t frames);
/// Throws Error (bad input) for what cannot be rendered from archives on several hosts.
void check_hosts(const ShotPlan& plan, const std::filesystem::path& shot_file);
void check_measures(const ShotPlan& plan, const std::filesystem::path& shot_file);
/// Readers put deep samples together by depth, and so must we.
void check_deep(const ShotPlan& plan, const std::filesystem::path& shot_file);

}  // namespace raystage
