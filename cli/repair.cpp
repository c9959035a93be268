// SPDX-License-Identifier: Apache-2.0
// raystage repair: rewrites damaged archives and journals of a take.
#include "store/fixity/repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/contained_path.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "store/bag_payload.h"

namespace raystage::cli {
namespace {

struct Options {
  std::string take, copy;
  bool dry_run = false, quiet = false;
  int threads = 0;
};

constexpr std::size_t kMaxShown = 4;

/// Returns "at 0.200000000 s, 0.250000000 s and 3 more: "; empty without times.
std::string times_text(const std::vector<Nanoseconds>& times) {
  if (times.empty()) return "";
  std::string text = "at ";
  for (std::size_t i = 0; i < std::min(times.size(), kMaxShown); ++i) {
    text += fmt::format("{}{:.9f} s", i == 0 ? "" : ", ",
                        static_cast<double>(times[i]) / kNanosecondsPerSecond);
  }
  if (times.size() > kMaxShown) text += fmt::format(" and {} more", times.size() - kMaxShown);
  return text + ": ";
}

/// Prints a line for each kind of loss.
void print_losses(const std::vector<store::SalvageResult::Loss>& losses) {
  struct Kind {
    std::string what;
    std::vector<Nanoseconds> times;
  };
  std::vector<Kind> kinds;
  for (const store::SalvageResult::Loss& loss : losses) {
    auto kind = std::ranges::find(kinds, loss.what, &Kind::what);
    if (kind == kinds.end()) kind = kinds.insert(kinds.end(), Kind{loss.what, {}});
    if (loss.time_ns != store::kUnknownTime) kind->times.push_back(loss.time_ns);
  }
  constexpr std::size_t kMaxKinds = 8;
  for (std::size_t i = 0; i < std::min(kinds.size(), kMaxKinds); ++i) {
    print("  lost or unverified: {}{}\n", times_text(kinds[i].times), kinds[i].what);
  }
  if (kinds.size() > kMaxKinds) print("  ... and {} more\n", kinds.size() - kMaxKinds);
}

void print_camera(const store::RepairReport::Camera& camera, bool dry_run) {
  if (!camera.error.empty()) {
    print("{}: cannot be repaired: {}\n", camera.id, camera.error);
    return;
  }
  const store::SalvageResult& s = camera.salvage;
  print("{}: {}, {} frames\n", camera.id, dry_run ? "would be rewritten" : "rewritten", s.frames);
  const auto count = [](std::int64_t number, std::string_view what) {
    if (number > 0) print("  {}: {}\n", what, number);
  };
  count(camera.frames_from_copy, "frames taken from the copy");
  count(s.corrected_records, "journal records with one flipped bit, corrected");
  count(s.reindexed_frames - s.unverified_frames, "frames added to the journal again, verified");
  count(s.unverified_frames, "frames added to the journal again, unverified");
  count(s.corrupt_frames, "frames lost, corrupt");
  count(s.truncated_frames, "frames lost, truncated");
  print_losses(s.losses);
  for (const std::string& name : camera.kept) print("  the original is kept as {}\n", name);
}

void print_file(const store::RepairReport::RestoredFile& file, bool dry_run) {
  if (!file.error.empty()) {
    print("{}: cannot be taken from the copy: {}\n", file.path, file.error);
  } else {
    print("{}: {} from the copy\n", file.path, dry_run ? "would be taken" : "taken");
  }
}

ExitCode repair(const Options& options, const std::stop_token& stop) {
  const ThreadLimit threads(options.threads);
  Progress progress(!options.quiet);
  store::RepairOptions how;
  how.dry_run = options.dry_run;
  if (!options.copy.empty()) how.copy = options.copy;
  how.progress = [&](double share) { progress.report(share); };
  how.stop = stop;
  if (!options.dry_run) store::require_no_bag_payload(options.take);
  const store::RepairReport report = store::repair_take(options.take, how);
  long intact = 0;
  for (const auto& camera : report.cameras) {
    intact += camera.was_intact ? 1 : 0;
    if (!camera.was_intact && !camera.id.empty()) print_camera(camera, options.dry_run);
  }
  for (const auto& file : report.files) print_file(file, options.dry_run);
  for (const Error& left_out : report.left_out) {
    print("{}: left out: a take has no links, pipes, devices or names like this\n",
          left_out.where());
  }
  print("{} of {} cameras were intact and are unchanged\n", intact, report.cameras.size());
  if (report.is_timeline_renumbered) {
    print("The timeline keeps its ticks; the lost frames are absent from it\n");
  }
  if (!report.renamed_timeline.empty()) {
    print("The timeline no longer matches and was renamed to {}: run `raystage sync`\n",
          report.renamed_timeline);
  }
  if (report.status != RunStatus::kFinished) return ExitCode::kFailed;
  const ExitCode code = report.failed()       ? ExitCode::kFailed
                        : report.has_losses() ? ExitCode::kSomeFramesFailed
                                              : ExitCode::kSuccess;
  if (!options.dry_run) {
    const auto cameras = static_cast<long>(report.cameras.size());
    const bool is_unchanged = intact == cameras && report.files.empty();
    record_event(options.take, is_unchanged ? "fixity check" : "modification",
                 options.copy.empty() ? "repair" : "repair --from another copy",
                 fmt::format("{} of {} cameras were intact, {} files taken from the copy", intact,
                             cameras, report.files.size()),
                 outcome_of(code));
  }
  return code;
}

}  // namespace
}  // namespace raystage::cli

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Completes an interrupted recording; rewrites damaged archives and journals from their\n"
      "undamaged frames and reports the lost ones. If anything was lost, the originals are\n"
      "kept next to the new files as CAMERA.mkv.damaged and CAMERA.journal.damaged. With --from,\n"
      "damaged and missing frames and files are taken from another copy of the take. Exit code 0:\n"
      "intact, nothing was lost; 3: intact again, but something was lost; 1: something could not\n"
      "be repaired; 2: no take.",
      "raystage repair");
  ::unsetenv(kFollowLinksVariable);  // nothing is written through links
  Options options;
  command.option("TAKE", options.take, "Folder of the take").required();
  command.flag(
      "-n,--dry-run", options.dry_run,
      "Report what would be done, with the same exit code, and write nothing (default: off)");
  command.option("--from COPY", options.copy,
                 "Folder of another copy of this take, as a mirror is, which is only read; each "
                 "frame taken from it is checked first (default: none)");
  add_threads_option(command, options.threads);
  command.flag("-q,--quiet", options.quiet, "No progress on stderr (default: off)");
  return parse_and_run(command, argc, argv, "repair",
                       [&](std::stop_token stop) { return repair(options, stop); });
}
