// SPDX-License-Identifier: Apache-2.0
// raystage evaluate: measures the error and time of a method on views with ground truth.
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/evaluation_options.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/sandbox_option.h"
#include "cli/threads.h"
#include "evaluation/evaluation.h"
#include "evaluation/evaluation_cases.h"
#include "render/methods.h"
#include "schemas/views_document.h"

namespace {

using namespace raystage;
using namespace raystage::cli;

struct Options {
  std::filesystem::path take, views, json, table;
  std::string focal_depth = "best", label;
  std::vector<std::string> method_options;
  evaluation::EvaluationOptions settings;
  int threads = 0;
  double memory_gb = 4;
  bool quiet = false;
};

/// Appends a row under one heading; the table is replaced atomically.
void append_row(const std::filesystem::path& file, const evaluation::Evaluation& evaluation,
                const std::string& label) {
  const std::string before =
      file_exists(file) ? read_file(file) : evaluation::evaluation_table_heading();
  write_file_atomically(file, before + evaluation::evaluation_table_row(evaluation, label));
}

ExitCode evaluate(const Options& options, std::stop_token stop) {
  const ThreadLimit limit(options.threads);
  evaluation::EvaluationOptions settings = options.settings;
  for (const std::string& text : options.method_options) {
    const auto [name, value] = render::option_from_text(text);
    settings.options[name] = value;
  }
  settings.focal_depth = parse_focal_depth(options.focal_depth);
  settings.memory_bytes = static_cast<std::size_t>(options.memory_gb * 1e9);
  const store::Take take(options.take);
  schemas::ViewsDocument views;
  if (!options.views.empty()) views = evaluation::read_views_with_truths(options.views);
  Progress progress(!options.quiet);
  const evaluation::Evaluation evaluation = evaluation::evaluate_views(
      take, views, {}, settings, [&](double done) { progress.report(done); }, stop);
  print(evaluation::evaluation_as_text(evaluation));
  if (!options.json.empty())
    write_file_atomically(options.json, evaluation::evaluation_as_json(evaluation));
  if (!options.table.empty()) {
    append_row(options.table, evaluation, options.label.empty() ? settings.method : options.label);
  }
  return evaluation.has_rot ? ExitCode::kFellShort : ExitCode::kSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine command(
      "Renders views with ground truth, each at its time, and measures error and time.",
      "raystage evaluate");
  Options options;
  command.option("TAKE", options.take, "Folder of the take").required();
  command.option(
      "VIEWS", options.views,
      "Views document (raystage/views/1) with truth images; can be omitted with --exclude-cameras");
  command
      .option("--method", options.settings.method,
              "Reconstruction method:" + render::describe_methods())
      .show_default();
  command.option("--option NAME=VALUE", options.method_options, "Option of the method; repeatable")
      .one_argument();
  add_truth_options(command, options.focal_depth, options.settings);
  add_blend_option(command, options.settings);
  command.choice("--fill", options.settings.fill,
                 {{"none", schemas::HoleFill::kNone}, {"push-pull", schemas::HoleFill::kPushPull}},
                 "Rays that no camera recorded: none (excluded from the measures) or push-pull "
                 "(filled from their surroundings, and measured) (default: none)");
  add_exact_times_option(command, options.settings);
  command.option("--camera-step", options.settings.camera_step, "Use every n-th row and column")
      .show_default()
      .positive();
  add_view_step_option(command, options.settings);
  command.flag("!--no-pixel-counts", options.settings.count_needed_pixels,
               "Do not count the source pixels that each view needs: takes half the time, no "
               "decoded/needed");
  command.option("--out", options.settings.image_folder,
                 "Folder for the rendered views, DIR/<view id>.png (default: not written)");
  command.option("--json", options.json, "Write the results as JSON to this file");
  command.option("--table", options.table,
                 "Append the mean as a row to this Markdown table (created if missing)");
  command.option("--label", options.label, "First column of that row (default: the method)");
  add_threads_option(command, options.threads);
  add_memory_option(command, options.memory_gb);
  add_follow_links_option(command);
  add_sandbox_option(command);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr");
  command.footer(
      "Exit codes: 0 all views were measured; 1 failed; 2 bad usage or input; 4 stored frames are "
      "rotten:\ntheir cameras are absent, views of which they are the truth are left out; 128+n "
      "stopped by signal n.");
  return parse_and_run(command, argc, argv, "evaluate",
                       [&](std::stop_token stop) { return evaluate(options, stop); },
                       OnSignal::kAbort,
                       {{"--leave-out", "--exclude-cameras"},
                        {"--views-step", "--view-step"},
                        {"--no-count", "--no-pixel-counts"}});
}
