// SPDX-License-Identifier: Apache-2.0
// raystage repair: what can be saved of a damaged take.
#include "store/fixity/repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/threads.h"

namespace raystage {
namespace {

struct Options {
  std::string take;
  bool dry_run = false, quiet = false;
  int threads = 0;
};

constexpr std::size_t kMostShown = 4;

/// "at 0.200000000 s, 0.250000000 s and 3 more: "; empty for what is no frame.
std::string times_text(const std::vector<Nanoseconds>& times) {
  if (times.empty()) return "";
  std::string text = "at ";
  for (std::size_t i = 0; i < std::min(times.size(), kMostShown); ++i) {
    text += fmt::format("{}{:.9f} s", i == 0 ? "" : ", ",
                        static_cast<double>(times[i]) / kNanosecondsPerSecond);
  }
  if (times.size() > kMostShown) text += fmt::format(" and {} more", times.size() - kMostShown);
  return text + ": ";
}

/// A line for each kind of loss, however many frames share it.
void print_losses(const std::vector<SalvageResult::Loss>& losses) {
  struct Kind {
    std::string what;
    std::vector<Nanoseconds> times;
  };
  std::vector<Kind> kinds;
  for (const SalvageResult::Loss& loss : losses) {
    auto kind = std::ranges::find(kinds, loss.what, &Kind::what);
    if (kind == kinds.end()) kind = kinds.insert(kinds.end(), Kind{loss.what, {}});
    if (loss.time_ns != kUnknownTime) kind->times.push_back(loss.time_ns);
  }
  constexpr std::size_t kMostKinds = 8;
  for (std::size_t i = 0; i < std::min(kinds.size(), kMostKinds); ++i) {
    fmt::print("  lost or in doubt: {}{}\n", times_text(kinds[i].times), kinds[i].what);
  }
  if (kinds.size() > kMostKinds) fmt::print("  ... and {} more\n", kinds.size() - kMostKinds);
}

void print_camera(const RepairReport::Camera& camera, bool dry_run) {
  if (!camera.error.empty()) {
    fmt::print("{}: cannot be repaired: {}\n", camera.id, camera.error);
    return;
  }
  const SalvageResult& s = camera.salvage;
  fmt::print("{}: {}, {} frames\n", camera.id, dry_run ? "would be written anew" : "written anew",
             s.frames);
  const auto count = [](std::int64_t number, std::string_view what) {
    if (number > 0) fmt::print("  {}: {}\n", what, number);
  };
  count(s.corrected_records, "records of the journal with one flipped bit, flipped back");
  count(s.reindexed_frames - s.unverified_frames, "frames put back into the journal, proven whole");
  count(s.unverified_frames, "frames put back into the journal, without proof that they are whole");
  count(s.corrupt_frames, "frames lost, rotten");
  count(s.truncated_frames, "frames lost, cut off");
  print_losses(s.losses);
  for (const std::string& name : camera.kept) fmt::print("  the original is kept as {}\n", name);
}

ExitCode repair(const Options& options, const std::stop_token& stop) {
  const ThreadLimit threads(options.threads);
  Progress progress(!options.quiet);
  RepairOptions how;
  how.dry_run = options.dry_run;
  how.progress = [&](double share) { progress.report(share); };
  how.stop = stop;
  const RepairReport report = repair_take(options.take, how);
  long whole = 0;
  for (const auto& camera : report.cameras) {
    whole += camera.was_intact ? 1 : 0;
    if (!camera.was_intact && !camera.id.empty()) print_camera(camera, options.dry_run);
  }
  fmt::print("{} of {} cameras were whole and stay as they are\n", whole, report.cameras.size());
  if (!report.renamed_timeline.empty()) {
    fmt::print("The timeline does not fit and is kept as {}: run `raystage sync`\n",
               report.renamed_timeline);
  }
  if (report.failed() || report.stopped) return ExitCode::kFailed;
  return report.has_losses() ? ExitCode::kSomeFramesFailed : ExitCode::kSuccess;
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app(
      "Completes an interrupted recording and rewrites damaged archives and journals from\n"
      "their undamaged frames; reports the lost ones. Originals of which anything was lost stay "
      "beside "
      "the\n"
      "new files as CAMERA.mkv.damaged and CAMERA.journal.damaged. Exit code 0: the take is whole "
      "and\n"
      "nothing was lost, 3: it is whole again, but something was lost, 1: something could not be\n"
      "repaired, 2: no take.",
      "raystage repair");
  Options options;
  app.add_option("TAKE", options.take, "Folder of the take")->required();
  app.add_flag(
      "-n,--dry-run", options.dry_run,
      "Say what would be done, with the same exit code, and change nothing (default: off)");
  add_threads_option(app, options.threads);
  app.add_flag("-q,--quiet", options.quiet, "No progress on stderr (default: off)");
  return parse_and_run(app, argc, argv, "repair",
                       [&](std::stop_token stop) { return repair(options, stop); });
}
