// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "cli/pack.h"
#include "store/temporal/video_encoder.h"

namespace raystage::cli {

enum class References { kNone, kTime, kCameras };

/// Options of `raystage pack --temporal`.
struct TemporalCommandOptions {
  std::string codec;  ///< hevc or av1; empty: without loss
  References references = References::kTime;
  std::optional<int> group;
  std::optional<double> crf, target_db;
  std::filesystem::path views;
  std::string method = "depth";
};

void add_temporal_options(CommandLine& command, TemporalCommandOptions& options);

/// Runs pack_temporal() and prints its report.
ExitCode run_pack_temporal(const PackCommandOptions& common, const TemporalCommandOptions& options,
                           const std::stop_token& stop);

}  // namespace raystage::cli
