// SPDX-License-Identifier: Apache-2.0
// raystage join: joins the recordings of several nodes to one take.
#include <fmt/format.h>

#include <cstdio>
#include <vector>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "ingest/record/join_takes.h"
#include "raystage_version.h"

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Joins the recordings of several nodes of one scene to one take. Frames are copied byte for\n"
      "byte and checked against their hashes; times count from the epoch of the earliest part.\n"
      "Warns on stderr if parts do not overlap in time, or if only some rigs are calibrated.",
      "raystage join");
  std::vector<std::filesystem::path> parts;
  std::filesystem::path output;
  bool quiet = false, documents_only = false;
  command.option("PART", parts, "Takes of the nodes, two or more")
      .required()
      .expected(2, 10000)
      .help_text("PART ...");
  command.option("-o,--output TAKE", output, "Folder of the new take; must not exist").required();
  command.flag(
      "--documents-only", documents_only,
      "Leave the archives in place: the take gets take.json, rig.json, journals and the\nsession "
      "records of the nodes, for `raystage sync` and distributed rendering (docs/farm.md)");
  add_follow_links_option(command);
  command.flag("-q,--quiet", quiet, "No progress on stderr");
  return parse_and_run(command, argc, argv, "join", [&](std::stop_token stop) {
    Progress progress(!quiet);
    const ingest::JoinReport report = ingest::join_takes(
        parts, output, "raystage " RAYSTAGE_VERSION, documents_only,
        [&](double done) { progress.report(done); }, stop);
    for (const std::string& warning : report.warnings) {
      print_error("raystage join: {}\n", warning);
    }
    constexpr double kMegabyte = 1e6;
    print("{}: {} cameras of {} parts, {} frames, {} recorded as missing, {:.1f} MB\n",
          output.string(), report.cameras, parts.size(), report.frames, report.missing,
          static_cast<double>(report.bytes) / kMegabyte);
    record_event(output, "information package merging",
                 fmt::format("join of {} parts", parts.size()),
                 fmt::format("{} frames, each compared with its XXH3", report.frames));
    return ExitCode::kSuccess;
  });
}
