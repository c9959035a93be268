// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "cli/choice_option.h"
#include "cli/command.h"
#include "compose/sequence.h"

namespace raystage {

/// Options of all commands that process the frames of a shot. Variables must outlive `app`.

/// Adds --relative-to.
inline void add_relative_to_option(CLI::App& app, std::filesystem::path& folder) {
  app.add_option("--relative-to", folder,
                 "folder that the paths in the shot are relative to, for a copy of the shot "
                 "elsewhere\n(default: the folder of SHOT)")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
}

/// Adds --cache.
inline void add_cache_option(CLI::App& app, std::filesystem::path& folder) {
  app.add_option("--cache", folder,
                 "folder for data derived from takes (DIR/depth/...), read from and stored there; "
                 "takes may then\nbe read-only (default: the folder of each take)")
      ->type_name("DIR");
}

/// Adds --missing.
inline void add_missing_option(CLI::App& app, MissingFrames& missing) {
  add_choice<MissingFrames>(app, "--missing", missing,
                            {{"error", MissingFrames::kError},
                             {"hold", MissingFrames::kHold},
                             {"black", MissingFrames::kBlack}},
                            "frames before or after the take: error = refuse to start; hold = show "
                            "the nearest\ninstant; black = empty frames (default: error)");
}

/// Adds --progress and --quiet.
inline void add_progress_option(CLI::App& app, ProgressStyle& style) {
  add_choice<ProgressStyle>(
      app, "--progress", style,
      {{"auto", ProgressStyle::kAuto},
       {"plain", ProgressStyle::kPlain},
       {"openjd", ProgressStyle::kOpenJd},
       {"none", ProgressStyle::kNone}},
      "on stderr: auto = a bar on a terminal, else plain; plain = \"Progress: "
      "42%\";\nopenjd = \"openjd_progress: 42\" (default: auto)");
  app.add_flag_callback(
         "-q,--quiet", [&style] { style = ProgressStyle::kNone; },
         "No progress on stderr: as --progress none")
      ->excludes("--progress");
}

}  // namespace raystage
