// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "base/error.h"
#include "cli/command_line.h"
#include "evaluation/evaluation.h"

namespace raystage::cli {

/// Options of the commands that measure methods: `raystage evaluate` and `raystage bench`.

/// Adds --focal-depth, for parse_focal_depth(), and --exclude-cameras.
inline void add_truth_options(CommandLine& command, std::string& focal_depth,
                              evaluation::EvaluationOptions& options) {
  command
      .option("--focal-depth", focal_depth,
              "Focal plane parallel to the array, metres in front of it; 'best': eq. 2.2 from the "
              "take's depth range")
      .show_default();
  command
      .option("--exclude-cameras ID,...", options.excluded_camera_ids,
              "Cameras (ids, comma separated) to exclude and use as truth")
      .one_argument(',');
}

/// Adds --blend.
inline void add_blend_option(CommandLine& command, evaluation::EvaluationOptions& options) {
  command.choice(
      "--blend", options.blend_space,
      {{"perceptual", store::BlendSpace::kPerceptual}, {"linear", store::BlendSpace::kLinear}},
      "Scale on which the cameras' samples are averaged: perceptual (sRGB's curve) or "
      "linear (default: perceptual)");
}

/// Adds --exact-times.
inline void add_exact_times_option(CommandLine& command, evaluation::EvaluationOptions& options) {
  command.flag(
      "--exact-times", options.exact_times,
      "Interpolate the pictures of the cameras along motion at the time of each view (default: the "
      "nearest tick of the timeline)");
}

/// Adds --view-step.
inline void add_view_step_option(CommandLine& command, evaluation::EvaluationOptions& options) {
  command.option("--view-step", options.view_step, "Render every n-th view only")
      .show_default()
      .positive();
}

/// Adds --memory.
inline void add_memory_option(CommandLine& command, double& memory_gb) {
  command
      .option("--memory", memory_gb,
              "Memory for decoded source frames, the method's caches and working buffers, GB = "
              "10^9 bytes")
      .show_default()
      .range(0.001, 1e5);
}

/// Parses --focal-depth: "best" (nullopt) or metres. Throws Error (bad input).
inline std::optional<double> parse_focal_depth(const std::string& text) {
  if (text == "best") return std::nullopt;
  std::size_t used = 0;
  double depth = 0;
  try {
    depth = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != text.size() || !(depth > 0)) {
    throw Error::bad_input("found '" + text + "', allowed: best, or a depth above 0 in metres",
                           "--focal-depth", "Use for example --focal-depth 4.5");
  }
  return depth;
}

}  // namespace raystage::cli
