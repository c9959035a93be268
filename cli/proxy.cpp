// SPDX-License-Identifier: Apache-2.0
// raystage proxy: writes the scene of a take as points or a mesh for other programs.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/follow_links_option.h"
#include "cli/sandbox_option.h"
#include "cli/shot_options.h"
#include "cli/simd_option.h"
#include "cli/threads.h"
#include "compose/proxy/proxy_files.h"
#include "render/common/method_options.h"

namespace raystage::cli {
namespace {

struct Options {
  std::filesystem::path take, output;
  compose::SceneProxyOptions proxy;
  std::vector<std::string> method_options;
  std::string simd;
  double seconds = 0, memory_gb = 2;
  std::size_t points = 500'000;
  int threads = 0;
  ProgressStyle progress = ProgressStyle::kAuto;
};

void declare(CommandLine& command, Options& options, char** argv) {
  command.option("TAKE", options.take, "folder of the take").required();
  command
      .option("-o,--output FILE.ply|FILE.glb", options.output,
              "file to write: .ply for points with colours that several cameras see, .glb for a "
              "mesh with a\ntexture of what the middle of the array sees; metres, y up")
      .required();
  command.option("--time S", options.seconds,
                 "time in the take, seconds since its first tick (default: 0)");
  command
      .option("--width PIXELS", options.proxy.width,
              "width of the views that are used, at most that of the cameras (default: 640)")
      .range(16, 16384);
  command
      .option("--views N", options.proxy.views,
              ".ply: number of cameras whose views are used, spread over the array (default: 5)")
      .range(1, 1000);
  command.option("--points N", options.points, ".ply: maximum number of points (default: 500000)")
      .range(1, 100'000'000);
  command.option("--method METHOD", options.proxy.method,
                 "reconstruction method that gives depths of surfaces (default: depth)");
  command.option("--option NAME=VALUE", options.method_options, "option of the method; repeatable")
      .one_argument();
  add_cache_option(command, options.proxy.cache_folder);
  add_threads_option(command, options.threads);
  add_simd_option(command, options.simd, argv);
  command
      .option("--memory GB", options.memory_gb,
              "memory for decoded source frames and the method, GB = 10^9 bytes (default: 2)")
      .range(1e-3, 1e5);
  add_follow_links_option(command);
  add_sandbox_option(command);
  add_progress_option(command, options.progress);
  command.footer(
      "Exit codes: 0 written; 1 failed; 2 bad usage or input; 4 written without cameras whose "
      "stored "
      "frames\nare rotten; 128+n stopped by signal n.");
}

/// Returns the tick nearest to a time of the take.
int tick_at(const store::Timeline& timeline, double seconds, const std::filesystem::path& take) {
  if (timeline.ticks.empty()) {
    throw Error::bad_input("the take's timeline is empty", take.string(),
                           "Run `raystage sync` and check its report");
  }
  const double length =
      static_cast<double>(timeline.ticks.back().time_ns - timeline.ticks.front().time_ns) / kNsPerS;
  if (!(seconds >= 0 && seconds <= length)) {
    throw Error::bad_input(
        fmt::format("the time is {} s, but the take has 0 to {:.3f} s", seconds, length),
        take.string(), "Choose another --time");
  }
  const auto tick = store::nearest_tick(
      timeline.ticks,
      timeline.ticks.front().time_ns + static_cast<Nanoseconds>(std::llround(seconds * kNsPerS)));
  return static_cast<int>(tick.value_or(0));
}

ExitCode write_proxy(Options& options, const std::stop_token& stop) {
  const std::string extension = options.output.extension().string();
  if (extension != ".ply" && extension != ".glb") {
    throw Error::bad_input("the scene can only be written as .ply or .glb", options.output.string(),
                           "Name the output FILE.ply or FILE.glb");
  }
  Progress progress(options.progress);
  compose::SceneProxyOptions& proxy = options.proxy;
  for (const std::string& text : options.method_options) {
    const auto [name, value] = render::option_from_text(text);
    proxy.options[name] = value;
  }
  proxy.max_points = options.points;
  proxy.memory_bytes = static_cast<std::size_t>(options.memory_gb * 1e9);
  proxy.progress = [&](double done) { progress.report(done); };
  ExitCode result = ExitCode::kSuccess;
  proxy.on_rotten_cameras = [&](const std::vector<std::string>& cameras) {
    progress.say(fmt::format(
        "cameras are absent, because their stored frames are rotten (XXH3): {}. Run `raystage "
        "verify` on the take, then `raystage repair`",
        fmt::join(cameras, ", ")));
    result = ExitCode::kFellShort;
  };
  const store::Take take(options.take);
  const store::Timeline timeline = store::read_timeline(take);
  proxy.tick = tick_at(timeline, options.seconds, options.take);

  const int threads = thread_count(options.threads);
  const ThreadLimit limit(threads);
  tbb::task_arena arena(threads);
  arena.execute([&] {
    const CancellationScope cancellation(stop);
    if (extension == ".ply") {
      const compose::PointCloud cloud = compose::make_point_cloud(take, timeline, proxy);
      write_file_atomically(options.output, compose::format_ply(cloud));
      progress.say(fmt::format("{}: {} points", options.output.string(), cloud.points.size()));
    } else {
      const compose::ProxyMesh mesh = compose::make_proxy_mesh(take, timeline, proxy);
      write_file_atomically(options.output,
                            compose::format_glb(mesh, options.output.stem().string()));
      progress.say(fmt::format("{}: {} triangles", options.output.string(), mesh.triangles.size()));
    }
  });
  return result;
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command{"Writes the scene of a take as points or a mesh for other programs.",
                      "raystage proxy"};
  Options options;
  declare(command, options, argv);
  return parse_and_run(command, argc, argv, "proxy",
                       [&](std::stop_token stop) { return write_proxy(options, stop); });
}
