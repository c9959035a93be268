// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "cli/choice_option.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/focal_depth.h"
#include "cli/threads.h"
#include "evaluation/evaluation.h"
#include "render/methods.h"
#include "schemas/views_document.h"

namespace {

using namespace raystage;

struct Options {
  std::filesystem::path take, views, json, table;
  std::string focal_depth = "best", label;
  std::vector<std::string> method_options;
  EvaluationSettings settings;
  int threads = 0;
  double memory_gb = 4;
  bool quiet = false;
};

/// Appends a row under one heading; the table is replaced atomically.
void append_row(const std::filesystem::path& file, const Evaluation& evaluation,
                const std::string& label) {
  const std::string before =
      std::filesystem::exists(file) ? read_file(file) : evaluation_table_heading();
  write_file_atomically(file, before + evaluation_table_row(evaluation, label));
}

ExitCode evaluate(const Options& options, std::stop_token stop) {
  const ThreadLimit limit(options.threads);
  EvaluationSettings settings = options.settings;
  for (const std::string& text : options.method_options) {
    const auto [name, value] = option_from_text(text);
    settings.options[name] = value;
  }
  settings.focal_depth = parse_focal_depth(options.focal_depth);
  settings.memory_bytes = static_cast<std::size_t>(options.memory_gb * 1e9);
  const Take take(options.take);
  ViewsDocument views;
  if (!options.views.empty()) views = read_views(options.views);
  Progress progress(!options.quiet);
  const Evaluation evaluation = evaluate_views(
      take, views, options.views.parent_path(), settings,
      [&](double done) { progress.report(done); }, stop);
  fmt::print("{}", evaluation_as_text(evaluation));
  if (!options.json.empty()) write_file_atomically(options.json, evaluation_as_json(evaluation));
  if (!options.table.empty()) {
    append_row(options.table, evaluation, options.label.empty() ? settings.method : options.label);
  }
  return ExitCode::kSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Renders views with known truth, each at its time, and measures error and time.",
               "raystage evaluate");
  Options options;
  app.add_option("TAKE", options.take, "Folder of the take")->required();
  app.add_option("VIEWS", options.views,
                 "Views document (raystage/views/1) with truth images; can be omitted with "
                 "--exclude-cameras");
  app.add_option("--method", options.settings.method, "Reconstruction method:" + describe_methods())
      ->capture_default_str();
  app.add_option("--option", options.method_options, "Option of the method, NAME=VALUE; repeatable")
      ->allow_extra_args(false)
      ->type_name("NAME=VALUE");
  app.add_option(
         "--focal-depth", options.focal_depth,
         "Focal plane parallel to the array, metres in front of it; 'best': eq. 2.2 from the "
         "take's depth range")
      ->capture_default_str();
  app.add_option("--exclude-cameras", options.settings.excluded_camera_ids,
                 "Cameras (ids, comma separated) to exclude and use as truth")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("ID,...");
  add_choice<BlendSpace>(
      app, "--blend", options.settings.blend_space,
      {{"perceptual", BlendSpace::kPerceptual}, {"linear", BlendSpace::kLinear}},
      "Scale on which the cameras' samples are averaged: perceptual (sRGB's curve) or linear "
      "(default: perceptual)");
  add_choice<HoleFill>(
      app, "--fill", options.settings.fill,
      {{"none", HoleFill::kNone}, {"push-pull", HoleFill::kPushPull}},
      "Rays that no camera recorded: none (excluded from the measures) or push-pull "
      "(filled from their surroundings, and measured) (default: none)");
  app.add_option("--camera-step", options.settings.camera_step,
                 "Use only every n-th row and column of the grid")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--view-step", options.settings.view_step, "Render every n-th view only")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_flag(
      "!--no-pixel-counts", options.settings.count_needed_pixels,
      "Do not count the source pixels that each view needs: no decoded/needed, in half the "
      "time");
  app.add_option("--out", options.settings.image_folder,
                 "Folder for the rendered views, DIR/<view id>.png (default: not written)");
  app.add_option("--json", options.json, "Write the results as JSON to this file");
  app.add_option("--table", options.table,
                 "Append the mean as a row to this Markdown table (created if missing)");
  app.add_option("--label", options.label, "First column of that row (default: the method)");
  add_threads_option(app, options.threads);
  app.add_option("--memory", options.memory_gb,
                 "Memory for decoded source frames, the method's caches and working buffers, "
                 "GB = 10^9 bytes")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 1e5));
  app.add_flag("-q,--quiet", options.quiet, "No progress on stderr");
  return parse_and_run(app, argc, argv, "evaluate",
                       [&](std::stop_token stop) { return evaluate(options, stop); },
                       OnSignal::kAbort,
                       {{"--leave-out", "--exclude-cameras"},
                        {"--views-step", "--view-step"},
                        {"--no-count", "--no-pixel-counts"}});
}
