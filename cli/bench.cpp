// SPDX-License-Identifier: Apache-2.0
// raystage bench: cost and error of each method and setting.
#include "evaluation/bench.h"

#include <fmt/format.h>

#include <set>

#include "base/atomic_file.h"
#include "cli/choice_option.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/focal_depth.h"
#include "cli/threads.h"
#include "render/methods.h"
#include "reports/bench_page.h"

namespace raystage {
namespace {

struct Options {
  std::string take, output, focal_depth = "best", settings_file;
  std::vector<std::string> views, settings;
  std::vector<int> threads;
  bool count_pixels = false, quiet = false;
  double memory_gb = 4;
  BenchPlan plan;
};

void declare(CLI::App& app, Options& options) {
  BenchPlan& plan = options.plan;
  app.add_option("TAKE", options.take, "Folder of the take")->required();
  app.add_option("VIEWS", options.views,
                 "Views documents (raystage/views/1) with truth images; can be omitted with "
                 "--exclude-cameras");
  app.add_option("-o,--output", options.output,
                 "Folder for trade.csv, trade.json and the page trade.html (default: not written)")
      ->type_name("DIR");
  app.add_option("--setting", options.settings,
                 "Method and options, LABEL:METHOD:NAME=VALUE,... or METHOD alone; repeatable "
                 "(default: every method, with each of its presets)")
      ->allow_extra_args(false)
      ->type_name("SETTING");
  app.add_option("--settings", options.settings_file,
                 "Document of settings (raystage/bench/1), instead or in addition")
      ->type_name("FILE");
  app.add_option("--focal-depth", options.focal_depth,
                 "Focal plane parallel to the array, metres in front of it; 'best': eq. 2.2 from "
                 "the take's depth range")
      ->capture_default_str();
  app.add_option("--exclude-cameras", plan.common.excluded_camera_ids,
                 "Cameras (ids, comma separated) to exclude and use as truth")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("ID,...");
  app.add_option("--camera-step", plan.camera_steps,
                 "Use only every n-th row and column of the grid, for each n: error against "
                 "camera spacing (default: 1)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::PositiveNumber)
      ->type_name("N,...");
  app.add_option("-j,--threads", options.threads,
                 "Threads, for each number: time against threads (default: 0, as many as CPU "
                 "affinity and control group grant)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Range(0, 1024))
      ->type_name("N,...");
  app.add_option("--view-step", plan.common.view_step, "Render every n-th view only")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  plan.common.repeat = 3;
  app.add_option("--repeat", plan.common.repeat,
                 "Timed renderings of each view after the first, at most as many as take "
                 "2 s; the median is reported")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_flag("--count-pixels", options.count_pixels,
               "Count pixels decoded per pixel needed: renders each view once more");
  app.add_option("--images", plan.pictures,
                 "Views shown on the page, spread evenly; pictures take at most 12 MiB in all")
      ->capture_default_str()
      ->check(CLI::Range(0, 1000));
  add_choice<BlendSpace>(
      app, "--blend", plan.common.blend_space,
      {{"perceptual", BlendSpace::kPerceptual}, {"linear", BlendSpace::kLinear}},
      "Scale on which the cameras' samples are averaged: perceptual (sRGB's curve) or linear "
      "(default: perceptual)");
  app.add_option("--memory", options.memory_gb,
                 "Memory for decoded source frames, the method's caches and working buffers, "
                 "GB = 10^9 bytes")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 1e5));
  app.add_flag("-q,--quiet", options.quiet, "No progress");
  app.footer(
      "Methods and their options: raystage render --methods.\n"
      "Exit codes: 0 every setting asked for was measured; 1 failed; 2 bad usage or input;\n"
      "3 some settings could not be rendered, the rest is done; 128+n stopped by signal n: the\n"
      "settings finished until then are in the files.");
}

/// Merges several documents; paths become relative to the working directory.
ViewsDocument views_in(const std::vector<std::string>& files) {
  ViewsDocument all;
  std::set<std::string> ids;
  for (const std::string& file : files) {
    ViewsDocument views = read_views(file);
    if (!all.views.empty() && views.color_space != all.color_space) {
      throw Error::bad_input("the colour space differs from that of " + files.front(), file,
                             "Measure views of different colour spaces separately");
    }
    all.color_space = views.color_space;
    for (ViewsDocument::View& view : views.views) {
      if (!ids.insert(view.geometry.id).second) {
        throw Error::bad_input("the view '" + view.geometry.id + "' exists twice", file,
                               "Give each view its own id");
      }
      const auto folder = std::filesystem::path(file).parent_path();
      view.file = std::filesystem::absolute(folder / view.file).string();
      all.views.push_back(std::move(view));
    }
  }
  return all;
}

bool choose_settings(const Options& options, BenchPlan& plan) {
  for (const std::string& text : options.settings) {
    plan.settings.push_back(parse_bench_setting(text));
  }
  if (!options.settings_file.empty()) {
    const BenchDocument bench = read_bench(options.settings_file);
    plan.settings.insert(plan.settings.end(), bench.settings.begin(), bench.settings.end());
  }
  const bool asked_for = !plan.settings.empty();
  if (!asked_for) plan.settings = default_bench_settings();
  return asked_for;
}

ExitCode bench(const Options& options, std::stop_token stop) {
  BenchPlan plan = options.plan;
  const bool asked_for = choose_settings(options, plan);
  plan.common.focal_depth = parse_focal_depth(options.focal_depth);
  plan.common.memory_bytes = static_cast<std::size_t>(options.memory_gb * 1e9);
  plan.common.count_needed_pixels = options.count_pixels;
  plan.threads.clear();
  for (const int threads : options.threads) plan.threads.push_back(thread_count(threads));
  if (plan.threads.empty()) plan.threads.push_back(thread_count(0));
  const Take take(options.take);
  const ViewsDocument views = views_in(options.views);
  const std::filesystem::path output = options.output;
  if (!output.empty()) create_folder(output);

  Progress progress(!options.quiet);
  const auto write_tables = [&](const BenchResult& so_far) {
    if (output.empty()) return;
    write_file_atomically(output / "trade.json", bench_as_json(so_far));
    write_file_atomically(output / "trade.csv", bench_as_csv(so_far));
  };
  const BenchResult trade = measure_bench(
      take, views, {}, plan, write_tables, [&](double done) { progress.report(done); }, stop);
  if (!output.empty() && !trade.rows.empty()) {
    write_file_atomically(output / "trade.html", bench_as_page(trade));
  }
  fmt::print("{}", bench_as_table(trade));
  bool failed = false;
  for (const BenchRow& row : trade.rows) {
    if (row.failure.empty()) continue;
    failed = true;
    progress.say(fmt::format("{}: {}", row.setting.label, row.failure));
  }
  if (!trade.complete) return ExitCode::kFailed;
  // A method without the required data of the take is a failure only if it was requested.
  return failed && asked_for ? ExitCode::kSomeFramesFailed : ExitCode::kSuccess;
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app("Measures methods and their settings on views with known truth: error against time.",
               "raystage bench");
  Options options;
  declare(app, options);
  return parse_and_run(app, argc, argv, "bench",
                       [&](std::stop_token stop) { return bench(options, stop); }, OnSignal::kAbort,
                       {{"--leave-out", "--exclude-cameras"},
                        {"--views-step", "--view-step"},
                        {"--pictures", "--images"}});
}
