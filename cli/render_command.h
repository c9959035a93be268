// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "compose/sequence.h"
#include "schemas/hole_fill.h"

namespace raystage::cli {

/// Options of `raystage render`.
struct RenderOptions {
  std::string shot, output, frames, simd;
  int threads = 0, frames_in_flight = 0;
  double memory_gb = 0;
  bool chromaticities = false, coverage = false, confidence = false, deep = false;
  std::string layout;
  std::filesystem::path color_config, cache_folder, relative_to;
  // Drafts: compose::DraftOptions.
  std::string method, scale;
  std::vector<std::string> method_options, layers;
  int camera_step = 1;
  compose::ExistingFiles existing = compose::ExistingFiles::kError;
  compose::MissingFrames missing = compose::MissingFrames::kError;
  std::optional<schemas::HoleFill> fill;
  store::RottenFrames rotten = store::RottenFrames::kAbsent;
  double target_error = 0, target_time = 0, least_coverage = 0;
  ProgressStyle progress = ProgressStyle::kAuto;
  // For several hosts, see docs/farm.md.
  std::vector<std::string> take_folders;
  bool missing_archives = false;
  std::string fragments;
  int jpeg_quality = 0;
  std::filesystem::path fingerprints;
};

void declare_render_options(CommandLine& command, RenderOptions& options, char** argv);

/// Renders the shot. `hosts`: as SequenceOptions; `hosts_description`: part of the first log line.
ExitCode render(const RenderOptions& options, Progress& progress, render::DistributedTakes* hosts,
                std::string_view hosts_description, std::stop_token stop);

}  // namespace raystage::cli
