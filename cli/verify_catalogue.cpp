// SPDX-License-Identifier: Apache-2.0
// raystage verify --catalogue: the fixity of all takes below a folder.
#include "cli/verify_catalogue.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "cli/command_line_parsing.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "schemas/json_text.h"
#include "store/catalogue/check_takes.h"

namespace raystage::cli {
namespace {

using CatalogueJson = nlohmann::ordered_json;
using Entry = store::CatalogueEntry;

constexpr double kMegabyte = 1e6;

Nanoseconds utc_now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// Returns the time to the second.
std::string utc_text(Nanoseconds time) {
  return format_utc(time / kNanosecondsPerSecond * kNanosecondsPerSecond);
}

std::string_view state_of(const Entry& entry) {
  if (entry.is_missing()) return "missing";
  if (entry.is_unreachable) return "unreachable";
  if (!entry.take.last_check) return "not_checked";
  return schemas::name_of(entry.take.last_check->result);
}

void print_take(const schemas::FixityCatalogue::Take& take) {
  const schemas::FixityCatalogue::Check& check = *take.last_check;
  const double megabytes = static_cast<double>(check.bytes) / kMegabyte;
  print("  {}: {}, {:.1f} MB in {:.1f} s\n", take.path, schemas::name_of(check.result), megabytes,
        check.seconds);
  for (const std::string& problem : check.problems) print("    {}\n", problem);
  const auto shown = static_cast<std::int64_t>(check.problems.size());
  if (check.problem_count > shown) print("    and {} problems more\n", check.problem_count - shown);
}

/// Appends what a check found to the event log of the take.
void log_check(const std::filesystem::path& take, const schemas::FixityCatalogue::Check& check) {
  using Result = schemas::FixityCatalogue::Result;
  using Outcome = schemas::TakeEvent::Outcome;
  if (check.result == Result::kUnreadable) return;  // no object is known that an event could name
  const bool is_intact = check.result == Result::kIntact;
  std::string note(schemas::name_of(check.result));
  if (check.problem_count > 0) note += fmt::format(", {} problems", check.problem_count);
  record_event(take, "fixity check", "verify --catalogue", note,
               is_intact ? Outcome::kSuccess : Outcome::kFailure);
}

void print_summary(const store::CatalogueReport& report) {
  long good = 0, due = 0, unchecked = 0, checked = 0;
  const Entry* next = nullptr;
  for (const Entry& entry : report.takes) {
    good += entry.is_good() ? 1 : 0;
    due += entry.is_due ? 1 : 0;
    unchecked += state_of(entry) == "not_checked" ? 1 : 0;
    checked += entry.was_checked ? 1 : 0;
    if (entry.is_missing()) {
      print("  {}: missing since {}, last intact {}\n", entry.take.path,
            utc_text(*entry.take.missing_since_utc),
            entry.take.last_intact_utc ? utc_text(*entry.take.last_intact_utc) : "never");
    } else if (entry.is_unreachable) {
      print("  {}: cannot be read and was not checked, last intact {}\n", entry.take.path,
            entry.take.last_intact_utc ? utc_text(*entry.take.last_intact_utc) : "never");
    } else if (!entry.was_checked && entry.take.last_check && !entry.is_good()) {
      print("  {}: {} since {}; repair it, or restore it from a copy\n", entry.take.path,
            state_of(entry), utc_text(entry.take.last_check->finished_utc));
    } else if (entry.is_new && !entry.take.last_check) {
      print("  {}: new\n", entry.take.path);
    }
    const bool counts = !entry.is_missing() && entry.take.last_check;
    if (counts && (next == nullptr || entry.due_utc < next->due_utc)) next = &entry;
  }
  for (const std::string& problem : report.problems) print("  {}\n", problem);
  print("{} takes: {} intact, {} not yet checked, {} due; {} checked now, {:.1f} MB in {:.1f} s\n",
        report.takes.size(), good, unchecked, due, checked,
        static_cast<double>(report.bytes) / kMegabyte, report.seconds);
  if (next != nullptr) print("next: {} on {}\n", next->take.path, utc_text(next->due_utc));
  print("catalogue: {}\n", report.file.string());
}

CatalogueJson json_of(const Entry& entry) {
  const auto time_or_null = [](const std::optional<Nanoseconds>& time) {
    return time ? CatalogueJson(format_utc(*time)) : CatalogueJson();
  };
  CatalogueJson json{{"take", entry.take.path},
                     {"name", entry.take.name},
                     {"result", state_of(entry)},
                     {"checked_now", entry.was_checked},
                     {"new", entry.is_new},
                     {"changed", entry.is_changed},
                     {"due", entry.is_due},
                     {"first_seen_utc", format_utc(entry.take.first_seen_utc)},
                     {"missing_since_utc", time_or_null(entry.take.missing_since_utc)},
                     {"last_intact_utc", time_or_null(entry.take.last_intact_utc)}};
  if (const auto& check = entry.take.last_check) {
    json["checked_utc"] = format_utc(check->finished_utc);
    json["due_utc"] = format_utc(entry.due_utc);
    json["bytes"] = check->bytes;
    json["problem_count"] = check->problem_count;
    json["problems"] = check->problems;
  }
  return json;
}

}  // namespace

void add_catalogue_options(CommandLine& command, CatalogueCommandOptions& options) {
  command.option(
      "--catalogue FOLDER", options.folder,
      "Check the takes below this folder that are due, and keep in a catalogue which take "
      "was checked when, and with which result; a run that was stopped or killed is "
      "continued where it was");
  command
      .option("--catalogue-file FILE", options.file,
              "The catalogue (default: FOLDER/raystage-fixity.json)")
      .needs("--catalogue");
  command
      .option(
          "--due-days DAYS", options.due_days,
          "Days from a check of a take to the next one; takes that are new or changed are due at "
          "once")
      .show_default()
      .limits(0.0, 36500.0)
      .needs("--catalogue");
  command
      .option("--limit-mbps MBPS", options.limit_mbps,
              "Read at most so many megabytes (10^6 bytes) per second (default: 0, no limit)")
      .limits(0.0, 1e6)
      .needs("--catalogue");
  command
      .flag("--report", options.only_reports,
            "Check and write nothing: report what the catalogue says, and which takes are due")
      .needs("--catalogue");
  command
      .flag("--forget-missing", options.forgets_missing,
            "Remove takes from the catalogue that are no longer there, unless their disk may be "
            "absent "
            "(docs/archivist.md)")
      .needs("--catalogue")
      .excludes("--report");
}

ExitCode verify_catalogue(const CatalogueCommandOptions& options, const std::string& json,
                          bool quiet, const std::stop_token& stop) {
  constexpr double kBytesPerMegabyte = 1e6;
  Progress progress(!quiet);
  const bool prints = json != "-";
  store::CatalogueOptions how;
  how.file = options.file;
  how.due_days = options.due_days;
  how.bytes_per_second = options.limit_mbps * kBytesPerMegabyte;
  how.only_reports = options.only_reports;
  how.forgets_missing = options.forgets_missing;
  how.now_utc = utc_now();
  how.progress = [&](double share) { progress.report(share); };
  how.stop = stop;
  how.on_checked = [&](const schemas::FixityCatalogue::Take& take) {
    if (prints) print_take(take);
    log_check(options.folder / take.path, *take.last_check);
  };
  const store::CatalogueReport report = store::check_takes_below(options.folder, how);
  if (prints) print_summary(report);
  if (!json.empty()) {
    CatalogueJson takes = CatalogueJson::array();
    for (const Entry& entry : report.takes) takes.push_back(json_of(entry));
    const CatalogueJson all{{"catalogue", report.file.string()},
                            {"folder", options.folder.string()},
                            {"due_days", options.due_days},
                            {"good", report.is_good()},
                            {"bytes", report.bytes},
                            {"seconds", report.seconds},
                            {"problems", report.problems},
                            {"takes", takes}};
    if (prints) {
      write_file_atomically(json, schemas::dump_json(all) + "\n");
    } else {
      print(schemas::dump_json(all) + "\n");
    }
  }
  return report.is_good() ? ExitCode::kSuccess : ExitCode::kFailed;
}

}  // namespace raystage::cli
