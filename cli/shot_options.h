// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "cli/command.h"
#include "cli/command_line.h"
#include "compose/sequence.h"

namespace raystage::cli {

/// Options of all commands that process the frames of a shot. Variables must outlive `command`.

/// Adds --relative-to.
inline void add_relative_to_option(CommandLine& command, std::filesystem::path& folder) {
  command
      .option("--relative-to DIR", folder,
              "base folder of the shot's relative paths, for a copy of the shot "
              "elsewhere\n(default: the folder of SHOT)")
      .existing_folder();
}

/// Adds --cache.
inline void add_cache_option(CommandLine& command, std::filesystem::path& folder) {
  command.option("--cache DIR", folder,
                 "folder for data derived from takes (DIR/depth/...), so that takes may be "
                 "read-only\n(default: the folder of each take)");
}

/// Adds --missing.
inline void add_missing_option(CommandLine& command, compose::MissingFrames& missing) {
  command.choice("--missing", missing,
                 {{"error", compose::MissingFrames::kError},
                  {"hold", compose::MissingFrames::kHold},
                  {"black", compose::MissingFrames::kBlack}},
                 "frames before or after the take: error = refuse to start; hold = use the nearest "
                 "light\nfield frame; black = empty frames (default: error)");
}

/// Adds --progress and --quiet.
inline void add_progress_option(CommandLine& command, ProgressStyle& style) {
  command.choice("--progress", style,
                 {{"auto", ProgressStyle::kAuto},
                  {"plain", ProgressStyle::kPlain},
                  {"openjd", ProgressStyle::kOpenJd},
                  {"none", ProgressStyle::kNone}},
                 "on stderr: auto = a bar on a terminal, else plain; plain = \"Progress: "
                 "42%\";\nopenjd = \"openjd_progress: 42\" (default: auto)");
  command
      .flag(
          "-q,--quiet", [&style] { style = ProgressStyle::kNone; },
          "No progress on stderr: as --progress none")
      .excludes("--progress");
}

}  // namespace raystage::cli
