// SPDX-License-Identifier: Apache-2.0
// raystage bag: writes a take as a bag of BagIt 1.0, and checks bags.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/child_process.h"
#include "base/error.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "raystage_version.h"
#include "schemas/json_text.h"
#include "store/bagit/check_bag.h"
#include "store/bagit/write_bag.h"

namespace raystage::cli {
namespace {

using Json = nlohmann::ordered_json;
using Level = store::BagCheckLevel;

constexpr double kBytesPerMb = 1e6;
const std::map<std::string, Level> kLevels{{"quick", Level::kQuick},
                                           {"completeness", Level::kCompleteness},
                                           {"checksums", Level::kChecksums}};

struct Options {
  std::string folder, output, check;
  std::vector<std::string> info;
  store::BagOptions how;
  int threads = 0;
  bool json = false, quiet = false;
};

std::string level_name(Level level) {
  for (const auto& [name, value] : kLevels) {
    if (value == level) return name;
  }
  return {};
}

/// Returns the folder of the installed descriptions of formats: share/raystage next to bin.
std::filesystem::path installed_representation() {
  return sibling_program("raystage").parent_path().parent_path() / "share" / "raystage";
}

Json json_of(const std::vector<store::BagProblem>& problems) {
  Json json = Json::array();
  for (const store::BagProblem& problem : problems) {
    json.push_back({{"file", problem.file},
                    {"description", problem.what},
                    {"found_by", level_name(problem.found_by)}});
  }
  return json;
}

std::string version_text(const store::BagVersion& version) {
  return fmt::format("{}.{}", version.major, version.minor);
}

Json json_of(const Options& options, const store::BagReport& report) {
  Json info = Json::array();
  for (const auto& element : report.info.elements) {
    info.push_back({{"label", element.label}, {"value", element.value}});
  }
  return {{"bag", options.folder},
          {"level", options.check},
          {"valid", report.is_valid()},
          {"version", version_text(report.declaration.version)},
          {"algorithms", report.algorithms},
          {"payload_files", report.payload_files},
          {"payload_bytes", report.payload_bytes},
          {"checked_bytes", report.checked_bytes},
          {"seconds", report.seconds},
          {"info", info},
          {"problems", json_of(report.problems)},
          {"omitted_problems", report.omitted_problems},
          {"warnings", json_of(report.warnings)}};
}

void print_text(const Options& options, const store::BagReport& report) {
  print("{}: BagIt {}, {} payload files, {:.1f} MB: {} (level: {})\n", options.folder,
        version_text(report.declaration.version), report.payload_files,
        static_cast<double>(report.payload_bytes) / kBytesPerMb,
        report.is_valid() ? "valid" : "not valid", options.check);
  for (const auto& problem : report.problems) print("  {}: {}\n", problem.file, problem.what);
  if (report.omitted_problems > 0) print("  {} more problems\n", report.omitted_problems);
  for (const auto& warning : report.warnings) {
    print("  warning: {}: {}\n", warning.file, warning.what);
  }
  if (report.checked_bytes > 0) {
    const double megabytes = static_cast<double>(report.checked_bytes) / kBytesPerMb;
    print("{:.1f} MB in {:.3f} s, {:.0f} MB/s\n", megabytes, report.seconds,
          megabytes / std::max(report.seconds, 1e-9));
  }
}

ExitCode check(const Options& options, const std::stop_token& stop) {
  Progress progress(!options.quiet);
  store::BagCheckOptions how;
  how.level = kLevels.at(options.check);
  how.progress = [&](double done) { progress.report(done); };
  how.stop = stop;
  const store::BagReport report = store::check_bag(options.folder, how);
  if (report.status != RunStatus::kFinished) return ExitCode::kFailed;
  if (options.json) {
    print(schemas::dump_json(json_of(options, report)) + "\n");
  } else {
    print_text(options, report);
  }
  return report.is_valid() ? ExitCode::kSuccess : ExitCode::kFailed;
}

ExitCode write(const Options& options, const std::stop_token& stop) {
  Progress progress(!options.quiet);
  store::BagOptions how = options.how;
  for (const std::string& text : options.info) {
    const std::size_t colon = text.find(':');
    if (colon == text.npos) {
      throw Error::bad_input(fmt::format("found \"{}\", allowed: \"LABEL: VALUE\"", text), "--info",
                             "Separate the label from its value by a colon");
    }
    std::string value = text.substr(colon + 1);
    value.erase(0, std::min(value.find_first_not_of(' '), value.size()));
    how.info.push_back({text.substr(0, colon), value});
  }
  how.program = "raystage";
  how.version = RAYSTAGE_VERSION;
  how.representation = installed_representation();
  how.progress = [&](double done) { progress.report(done); };
  how.on_damage = [&](const auto& event) { record_made_event(options.folder, event); };
  how.stop = stop;
  const store::Take take(options.folder);
  const store::BagWriteReport report = store::write_bag(take, options.output, how);
  for (const auto& event : report.events) record_made_event(options.folder, event);
  if (report.damaged_log_lines > 0) {
    print_error("raystage bag: {} lines of the take's events.jsonl are damaged\n",
                report.damaged_log_lines);
  }
  if (options.json) {
    const Json json{{"take", options.folder},          {"output", options.output},
                    {"identifier", report.identifier}, {"ocfl", how.is_ocfl},
                    {"payload_files", report.files},   {"payload_bytes", report.bytes},
                    {"tag_files", report.tag_files}};
    print(schemas::dump_json(json) + "\n");
  } else {
    print("{}: {} files, {:.1f} MB, {} tag files, every frame verified\nIdentifier {}\n",
          options.output, report.files, static_cast<double>(report.bytes) / kBytesPerMb,
          report.tag_files, report.identifier);
  }
  return ExitCode::kSuccess;
}

/// Throws Error (bad input) for options that do not fit together.
void require_one_task(const Options& options) {
  if (options.output.empty() == options.check.empty()) {
    throw Error::bad_input("a take is written as a bag, or a bag is checked", "",
                           "Give either -o BAG or --check LEVEL");
  }
  const bool has_write_options =
      options.how.is_ocfl || !options.info.empty() || !options.how.identifier.empty();
  if (!options.check.empty() && has_write_options) {
    throw Error::bad_input("--check writes no bag", "", "Omit --ocfl, --info and --identifier");
  }
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Writes a take as a bag (BagIt 1.0, RFC 8493): its files unchanged with their SHA-256, the\n"
      "XXH3 of files and frames, its events as PREMIS 3 XML, and descriptions of its formats. The\n"
      "copy of each frame is verified. Hidden files and depth/ are left out. Or checks a bag, of "
      "any\n"
      "program, of versions 0.93 to 1.0, with MD5, SHA-1 or SHA-2.",
      "raystage bag");
  Options options;
  command
      .option(
          "FOLDER", options.folder,
          "Folder of the take, to which only an event is added; with --check, of the bag, which "
          "is only\nread")
      .required();
  command.option("-o,--output BAG", options.output, "Folder of the new bag; must not exist");
  command
      .option(
          "--check LEVEL", options.check,
          "Check a bag: quick = number and total size of payload files (Payload-Oxum); "
          "completeness =\nalso that each file is listed and each listed file exists; checksums "
          "= also every byte")
      .one_of_listed({"quick", "completeness", "checksums"});
  command.flag("--ocfl", options.how.is_ocfl,
               "Write an OCFL 1.1 object, whose v1/content is the bag (default: off)");
  command
      .option("--identifier ID", options.how.identifier,
              "External-Identifier of the bag and id of the OCFL object, a URI (default: from "
              "name and time 0 of\nthe take)")
      .check([](const std::string& text) {
        return text.empty() ? "the identifier is empty: give a URI, or omit the option" : "";
      });
  command
      .option("--info TEXT", options.info,
              "Line of bag-info.txt, \"LABEL: VALUE\"; may be repeated (default: none)")
      .one_argument();
  add_threads_option(command, options.threads);
  command.flag("--json", options.json, "Print the results as JSON (default: off)");
  command.flag("-q,--quiet", options.quiet, "No progress on stderr (default: off)");
  command.footer(
      "Exit codes: 0 the bag was written, or is valid; 1 failed, or the bag is not valid; 2 bad "
      "usage\n"
      "or input, such as a damaged take, or no bag; 128+n stopped by signal n. Nothing remains of "
      "a "
      "bag\n"
      "that was not completed, except a hidden folder .BAG.*.tmp after kill -9 or a power loss, "
      "which the\n"
      "next run on this machine with the same -o removes.");
  return parse_and_run(command, argc, argv, "bag", [&](const std::stop_token& stop) {
    require_one_task(options);
    const ThreadLimit limit(options.threads);
    return options.check.empty() ? write(options, stop) : check(options, stop);
  });
}
