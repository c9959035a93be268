// SPDX-License-Identifier: Apache-2.0
// raystage sync: the timeline of a take.
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>

#include "cli/command.h"
#include "cli/parse.h"
#include "store/timeline.h"

namespace raystage {
namespace {

constexpr double kNsPerMs = 1e6;

struct Options {
  std::string take;
  double fps = 0, tolerance_ms = 0;
  bool json = false;
};

void print_text(const Take& take, const Timeline& timeline, const TimelineStatistics& statistics) {
  const long absent = std::reduce(statistics.absent.begin(), statistics.absent.end(), 0L);
  const auto cameras = static_cast<double>(statistics.absent.size());
  const auto ticks = static_cast<double>(timeline.ticks.size());
  fmt::print("Rate       {:.6g} Hz\n", timeline.fps);
  fmt::print("Ticks      {}, from {:.6f} s to {:.6f} s\n", timeline.ticks.size(),
             static_cast<double>(timeline.ticks.front().time_ns) / 1e9,
             static_cast<double>(timeline.ticks.back().time_ns) / 1e9);
  fmt::print("Tolerance  {:.3f} ms\n", static_cast<double>(timeline.tolerance) / kNsPerMs);
  fmt::print("Spread     mean {:.3f} ms, median {:.3f} ms, at most {:.3f} ms\n",
             statistics.mean_spread_ns / kNsPerMs,
             static_cast<double>(statistics.median_spread) / kNsPerMs,
             static_cast<double>(statistics.max_spread) / kNsPerMs);
  fmt::print("Absent     {} of {:.0f} frames ({:.2f} %)\n", absent, cameras * ticks,
             100 * static_cast<double>(absent) / (cameras * ticks));
  for (std::size_t i = 0; i < statistics.absent.size(); ++i) {
    if (statistics.absent[i] == 0) continue;
    fmt::print("  {:<10} {} of {}\n", take.document().cameras[i].id, statistics.absent[i],
               timeline.ticks.size());
  }
}

void print_json(const Take& take, const Timeline& timeline, const TimelineStatistics& statistics) {
  auto absent = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < statistics.absent.size(); ++i) {
    if (statistics.absent[i] > 0) {
      absent[take.document().cameras[i].id] = statistics.absent[i];
    }
  }
  const nlohmann::ordered_json document{
      {"fps", timeline.fps},
      {"tolerance_ns", timeline.tolerance},
      {"ticks", timeline.ticks.size()},
      {"first_ns", timeline.ticks.front().time_ns},
      {"last_ns", timeline.ticks.back().time_ns},
      {"spread_ms",
       {{"mean", statistics.mean_spread_ns / kNsPerMs},
        {"median", static_cast<double>(statistics.median_spread) / kNsPerMs},
        {"max", static_cast<double>(statistics.max_spread) / kNsPerMs}}},
      {"absent_total", std::reduce(statistics.absent.begin(), statistics.absent.end(), 0L)},
      {"absent", absent}};
  fmt::print("{}\n", document.dump(2));
}

ExitCode sync(const Options& options) {
  const Take take(options.take);
  const auto tolerance = static_cast<Nanoseconds>(std::llround(options.tolerance_ms * kNsPerMs));
  const Timeline timeline = build_timeline(take, options.fps, tolerance);
  write_timeline(timeline, take.folder());
  const TimelineStatistics statistics = statistics_of(timeline);
  (options.json ? print_json : print_text)(take, timeline, statistics);
  return ExitCode::kSuccess;
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app(
      "Align the free-running cameras of a take in time: ticks at a constant rate, each with the\n"
      "nearest frame of every camera. Written to TAKE/timeline.zst; the archives stay as they are.",
      "raystage sync");
  Options options;
  app.add_option("TAKE", options.take, "Folder of the take")->required();
  app.add_option("--fps", options.fps,
                 "Ticks per second, Hz (default: the cameras' own rate, detected)")
      ->check(CLI::Range(1e-3, 1e6).description(""));
  app.add_option("--tolerance", options.tolerance_ms,
                 "How far a frame may lie from its tick, ms (default: half a frame time); a camera "
                 "without a frame that near is absent")
      ->check(CLI::Range(1e-6, 1e9).description(""));
  app.add_flag("--json", options.json, "Print the result as JSON");
  return parse_and_run(app, argc, argv, "sync", [&](std::stop_token) { return sync(options); });
}
