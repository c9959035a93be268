// SPDX-License-Identifier: Apache-2.0
// raystage render under MPI: one of the ranks, each of which holds some of the cameras.
#include <fmt/format.h>

#include <exception>
#include <new>

#include "cli/printing.h"
#include "cli/render_command.h"
#include "cli/threads.h"
#include "farm/path_map.h"
#include "farm/ranks/root_rank.h"
#include "farm/ranks/worker_rank.h"

namespace raystage::cli {
namespace {

render::FragmentEncodingOptions encoding_of(const RenderOptions& options) {
  render::FragmentEncodingOptions settings;
  if (options.fragments == "half") settings.encoding = render::FragmentEncoding::kHalf;
  if (options.fragments == "jpeg") settings.encoding = render::FragmentEncoding::kJpeg;
  if (options.jpeg_quality > 0) settings.jpeg_quality = options.jpeg_quality;
  return settings;
}

std::vector<farm::PathMappingRule> folders_of(const RenderOptions& options) {
  std::vector<farm::PathMappingRule> rules;
  for (const std::string& text : options.take_folders) {
    rules.push_back(farm::parse_path_rule(text));
  }
  return rules;
}

constexpr double kMegabyte = 1e6;

std::string traffic_text(const farm::RankTraffic& traffic) {
  const auto pixels = static_cast<double>(std::max<std::int64_t>(traffic.view_pixels, 1));
  return fmt::format(
      "between ranks: {:.3f} samples per view pixel, {} fragments, {:.2f} MB; {} parts of frames, "
      "{:.2f} MB; {:.2f} MB in total",
      static_cast<double>(traffic.fragments.samples) / pixels, traffic.fragments.fragments,
      static_cast<double>(traffic.fragments.bytes) / kMegabyte, traffic.frames.requests,
      static_cast<double>(traffic.frames.bytes) / kMegabyte,
      static_cast<double>(traffic.costs.bytes_sent) / kMegabyte);
}

std::string costs_text(const farm::RankTraffic& traffic) {
  const auto views = static_cast<double>(std::max<std::int64_t>(traffic.views, 1));
  const farm::ReduceTimes& times = traffic.times;
  return fmt::format(
      "all ranks: {:.2f} CPU seconds, {:.2f} of them waiting; ms per view: rank 0: own cameras "
      "{:.1f}, waiting {:.1f}, adding fragments {:.1f}; slowest other rank: own cameras {:.1f}, "
      "adding {:.1f}, encoding fragments {:.1f}; messages and idle {:.1f}",
      traffic.costs.cpu_seconds, traffic.costs.waiting_cpu_seconds, times.local_ms / views,
      times.wait_ms / views, times.add_ms / views, times.slowest.local_ms / views,
      times.slowest.add_ms / views, times.slowest.encode_ms / views, times.travel_ms() / views);
}

ExitCode render_as_first(farm::MpiWorld& world, const RenderOptions& options,
                         const std::stop_token& stop) {
  Progress progress(options.progress);
  farm::RootRank ranks(
      world,
      {folders_of(options),
       options.missing_archives ? farm::MissingArchives::kAbsent : farm::MissingArchives::kError,
       encoding_of(options), [&](std::string_view line) { progress.say(line); }});
  const ExitCode code =
      render(options, progress, &ranks, fmt::format(", the first of {} ranks", world.size()), stop);
  const farm::RankTraffic traffic = ranks.finish();
  progress.say(traffic_text(traffic));
  progress.say(costs_text(traffic));
  return code;
}

void serve(farm::MpiWorld& world, const RenderOptions& options) {
  const int threads = thread_count(options.threads);
  const ThreadLimit limit(threads);
  try {
    farm::run_worker_rank(world,
                          {folders_of(options), encoding_of(options), threads, kOutOfMemoryCode});
  } catch (const std::bad_alloc&) {
    print_error("raystage render: rank {}: out of memory\n", world.rank());
    world.abort(kOutOfMemoryCode);
  } catch (const std::exception& error) {  // otherwise the other ranks wait forever
    print_error("raystage render: rank {}: {}\n", world.rank(), error.what());
    world.abort(static_cast<int>(ExitCode::kFailed));
  }
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command{"Renders a shot as an EXR sequence, as one rank of several.",
                      "raystage render"};
  RenderOptions options;
  declare_render_options(command, options, argv);
  return parse_and_run(command, argc, argv, "render", [&](std::stop_token stop) {
    folders_of(options);  // rejects invalid ones before other ranks wait
    farm::MpiWorld world(&argc, &argv);
    if (world.rank() == 0) return render_as_first(world, options, stop);
    serve(world, options);
    return ExitCode::kSuccess;
  });
}
