// SPDX-License-Identifier: Apache-2.0
// raystage bench: cost and error of each method and setting.
#include "evaluation/bench.h"

#include <fmt/format.h>

#include <set>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/evaluation_options.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/sandbox_option.h"
#include "cli/threads.h"
#include "evaluation/evaluation_cases.h"
#include "render/methods.h"
#include "reports/bench_page.h"

namespace raystage::cli {
namespace {

struct Options {
  std::string take, output, focal_depth = "best", settings_file;
  std::vector<std::string> views, settings;
  std::vector<int> threads;
  bool count_pixels = false, quiet = false;
  double memory_gb = 4;
  evaluation::BenchPlan plan;
};

void declare(CommandLine& command, Options& options) {
  evaluation::BenchPlan& plan = options.plan;
  command.option("TAKE", options.take, "Folder of the take").required();
  command.option("VIEWS", options.views,
                 "Views documents (raystage/views/1) with truth images; can be omitted with "
                 "--exclude-cameras");
  command.option("-o,--output DIR", options.output,
                 "Folder for trade.csv, trade.json and the page trade.html (default: not written)");
  command
      .option("--setting SETTING", options.settings,
              "Method and options, LABEL:METHOD:NAME=VALUE,... or METHOD alone; repeatable "
              "(default: every method, with each of its presets)")
      .one_argument();
  command.option("--settings FILE", options.settings_file,
                 "Document of settings (raystage/bench/1), instead of or in addition to --setting");
  add_truth_options(command, options.focal_depth, plan.common);
  command
      .option("--camera-step N,...", plan.camera_steps,
              "Use only every n-th row and column of the grid; measures each n (default: 1)")
      .one_argument(',')
      .positive();
  command
      .option("-j,--threads N,...", options.threads,
              "Numbers of threads to measure with (default: 0, as many as CPU affinity and control "
              "group grant)")
      .one_argument(',')
      .range(0, 1024);
  add_exact_times_option(command, plan.common);
  add_view_step_option(command, plan.common);
  plan.common.repeat = 3;
  command
      .option(
          "--repeat", plan.common.repeat,
          "Timed renderings of each view after the first, for at most 2 s; the median is reported")
      .show_default()
      .range(1, 1000);
  command.flag("--count-pixels", options.count_pixels,
               "Count pixels decoded per pixel needed: renders each view once more");
  command
      .option(
          "--images", plan.pictures,
          "Number of views on the page, evenly spaced; their images are at most 12 MiB in total")
      .show_default()
      .range(0, 1000);
  command
      .option("--crops", plan.crops,
              "Number of places on the page where the settings are compared enlarged: where they "
              "differ or err most")
      .show_default()
      .range(0, 48);
  add_blend_option(command, plan.common);
  add_memory_option(command, options.memory_gb);
  add_follow_links_option(command);
  add_sandbox_option(command);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr");
  command.footer(
      "Methods and their options: raystage render --methods.\n"
      "Exit codes: 0 all requested settings were measured; 1 failed; 2 bad usage or input;\n3 some "
      "settings failed, the rest is done; 4 stored frames are rotten: they were left out;\n128+n "
      "stopped by signal n: the files contain "
      "the\nsettings that were finished.");
}

/// Merges several documents.
schemas::ViewsDocument views_in(const std::vector<std::string>& files) {
  schemas::ViewsDocument all;
  std::set<std::string> ids;
  for (const std::string& file : files) {
    schemas::ViewsDocument views = evaluation::read_views_with_truths(file);
    if (!all.views.empty() && views.color_space != all.color_space) {
      throw Error::bad_input("the colour space differs from that of " + files.front(), file,
                             "Measure views of different colour spaces separately");
    }
    all.color_space = views.color_space;
    for (schemas::ViewsDocument::View& view : views.views) {
      if (!ids.insert(view.geometry.id).second) {
        throw Error::bad_input("the view '" + view.geometry.id + "' exists twice", file,
                               "Give each view its own id");
      }
      all.views.push_back(std::move(view));
    }
  }
  return all;
}

bool choose_settings(const Options& options, evaluation::BenchPlan& plan) {
  for (const std::string& text : options.settings) {
    plan.settings.push_back(evaluation::parse_bench_setting(text));
  }
  if (!options.settings_file.empty()) {
    const schemas::BenchDocument bench = schemas::read_bench(options.settings_file);
    plan.settings.insert(plan.settings.end(), bench.settings.begin(), bench.settings.end());
  }
  const bool asked_for = !plan.settings.empty();
  if (!asked_for) plan.settings = evaluation::default_bench_settings();
  return asked_for;
}

ExitCode bench(const Options& options, std::stop_token stop) {
  evaluation::BenchPlan plan = options.plan;
  const bool asked_for = choose_settings(options, plan);
  plan.common.focal_depth = parse_focal_depth(options.focal_depth);
  plan.common.memory_bytes = static_cast<std::size_t>(options.memory_gb * 1e9);
  plan.common.count_needed_pixels = options.count_pixels;
  plan.threads.clear();
  for (const int threads : options.threads) plan.threads.push_back(thread_count(threads));
  if (plan.threads.empty()) plan.threads.push_back(thread_count(0));
  const store::Take take(options.take);
  const schemas::ViewsDocument views = views_in(options.views);
  const std::filesystem::path output = options.output;
  if (output.empty()) plan.crops = plan.pictures = 0;  // no page shows them
  if (!output.empty()) create_folder(output);

  Progress progress(!options.quiet);
  const auto write_tables = [&](const evaluation::BenchResult& so_far) {
    if (output.empty()) return;
    write_file_atomically(output / "trade.json", evaluation::bench_as_json(so_far));
    write_file_atomically(output / "trade.csv", evaluation::bench_as_csv(so_far));
  };
  const evaluation::BenchResult trade = evaluation::measure_bench(
      take, views, {}, plan, write_tables, [&](double done) { progress.report(done); }, stop);
  if (!output.empty() && !trade.rows.empty()) {
    write_file_atomically(output / "trade.html", reports::bench_as_page(trade));
  }
  print(evaluation::bench_as_table(trade));
  bool failed = false;
  for (const evaluation::BenchRow& row : trade.rows) {
    if (row.failure.empty()) continue;
    failed = true;
    progress.say(fmt::format("{}: {}", row.setting.label, row.failure));
  }
  if (!trade.complete) return ExitCode::kFailed;
  // A method without the required data of the take is a failure only if it was requested.
  if (failed && asked_for) return ExitCode::kSomeFramesFailed;
  const bool has_rot = std::ranges::any_of(
      trade.rows, [](const evaluation::BenchRow& row) { return row.evaluation.has_rot; });
  return has_rot ? ExitCode::kFellShort : ExitCode::kSuccess;
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command("Measures error and time of methods and settings on views with ground truth.",
                      "raystage bench");
  Options options;
  declare(command, options);
  return parse_and_run(command, argc, argv, "bench",
                       [&](std::stop_token stop) { return bench(options, stop); }, OnSignal::kAbort,
                       {{"--leave-out", "--exclude-cameras"},
                        {"--views-step", "--view-step"},
                        {"--pictures", "--images"}});
}
