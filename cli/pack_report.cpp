// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/follow_links_option.h"
#include "cli/pack.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "schemas/json_text.h"

namespace raystage::cli {
namespace {

using Camera = store::PackReport::Camera;
constexpr double kBytesPerMb = 1e6;

double megabytes(std::uint64_t bytes) { return static_cast<double>(bytes) / kBytesPerMb; }

/// Per cent of the bytes before; negative if there are more after.
double saved_percent(const Camera& camera) {
  if (camera.bytes_before == 0) return 0;
  return 100 *
         (1 - static_cast<double>(camera.bytes_after) / static_cast<double>(camera.bytes_before));
}

/// Bytes of JPEG for each second of one thread.
double megabytes_per_second(const store::PackReport& report, const Camera& total, bool unpack) {
  const std::uint64_t jpeg = unpack ? total.bytes_after : total.bytes_before;
  return megabytes(jpeg) / std::max(report.thread_seconds, 1e-9);
}

void print_text(const PackCommandOptions& options, const store::PackReport& report, bool unpack) {
  const Camera total = report.total();
  print("{}: {} cameras, {} frames, {:.1f} MB -> {:.1f} MB", options.output, report.cameras.size(),
        total.frames, megabytes(total.bytes_before), megabytes(total.bytes_after));
  if (unpack) {
    print("; {} frames unpacked, each compared with its XXH3\n", total.packed);
  } else {
    print(", {:.1f} % saved; {} frames packed, each unpacked again and compared\n",
          saved_percent(total), total.packed);
    const auto [least, most] =
        std::ranges::minmax(report.cameras, {}, [](const Camera& c) { return saved_percent(c); });
    if (report.cameras.size() > 1) {
      print("Cameras    {:.1f} % saved ({}) to {:.1f} % ({}); --json lists all\n",
            saved_percent(least), least.id, saved_percent(most), most.id);
    }
    for (const auto& [why, count] : total.refusals) {
      print("Refused    {} frames stay as they are: {}\n", count, why);
    }
  }
  if (report.thread_seconds == 0) return;  // no frame was JPEG
  print("Speed      {:.1f} s, {:.1f} MB/s of JPEG per thread\n", report.seconds,
        megabytes_per_second(report, total, unpack));
}

nlohmann::ordered_json json_of(const Camera& camera) {
  return {{"frames", camera.frames},
          {"packed", camera.packed},
          {"bytes_before", camera.bytes_before},
          {"bytes_after", camera.bytes_after},
          {"refusals", camera.refusals}};
}

void print_json(const PackCommandOptions& options, const store::PackReport& report, bool unpack) {
  const Camera total = report.total();
  nlohmann::ordered_json json{{"take", options.take}, {"output", options.output}};
  json.update(json_of(total));
  json["seconds"] = report.seconds;
  json["thread_seconds"] = report.thread_seconds;
  json["megabytes_per_thread_second"] = megabytes_per_second(report, total, unpack);
  json["cameras"] = nlohmann::ordered_json::array();
  for (const Camera& camera : report.cameras) {
    nlohmann::ordered_json entry{{"id", camera.id}};
    entry.update(json_of(camera));
    json["cameras"].push_back(std::move(entry));
  }
  print(schemas::dump_json(json) + "\n");
}

}  // namespace

void add_pack_options(CommandLine& command, PackCommandOptions& options) {
  command.option("TAKE", options.take, "Folder of the take; it is not modified").required();
  command.option("-o,--output NEWTAKE", options.output, "Folder of the new take; must not exist")
      .required();
  add_threads_option(command, options.threads);
  command.flag("--json", options.json, "Print the results as JSON");
  add_follow_links_option(command);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr");
}

ExitCode run_pack(const PackCommandOptions& options, bool unpack, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  Progress progress(!options.quiet);
  store::PackOptions how = options.how;
  how.progress = [&](double done) { progress.report(done); };
  how.stop = stop;
  const store::Take take(options.take);
  const store::PackReport report = unpack ? store::unpack_take(take, options.output, how)
                                          : store::pack_take(take, options.output, how);
  const Camera total = report.total();
  record_event(options.output, unpack ? "decompression" : "compression",
               unpack ? "unpack" : fmt::format("pack --effort {}", options.how.effort),
               fmt::format("{} of {} frames, each compared", total.packed, total.frames));
  if (options.json) {
    print_json(options, report, unpack);
  } else {
    print_text(options, report, unpack);
  }
  return ExitCode::kSuccess;
}

}  // namespace raystage::cli
