// SPDX-License-Identifier: Apache-2.0
#include "cli/export_options.h"

#include <fmt/format.h>

#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/threads.h"
#include "compose/frame_range.h"
#include "store/absent_archives.h"

namespace raystage::cli {

void add_take_options(CommandLine& command, ExportOptions& options, const std::string& output_name,
                      const std::string& output_help) {
  command.option("TAKE", options.take, "the take").required();
  command.option("-o,--output " + output_name, options.output, output_help).required();
  command
      .option("--cameras ID,...", options.cameras,
              "cameras to export, in this order (default: all)")
      .comma_separated();
  command.choice("--missing-archives", options.missing_archives,
                 {{"error", false}, {"absent", true}},
                 "cameras whose archives are missing: error = stop before anything is written; "
                 "absent = they have\nno frames, others are exported (default: error)");
  add_follow_links_option(command);
}

store::Take open_take(const ExportOptions& options) {
  store::Take take(options.take,
                   options.missing_archives ? store::make_absent_archives(options.take) : nullptr);
  const std::string missing = store::describe_missing_archives(take);
  if (!missing.empty()) print_error("note: {}\n", missing);
  return take;
}

void add_frame_options(CommandLine& command, ExportOptions& options, OfferedTimes times,
                       const std::string& absent) {
  command.option("--frames RANGE", options.frames,
                 "frames to export, e.g. 1-48, 1-48x2 (every second), 1,5,10-20; frame n is tick n "
                 "- 1 of\nthe timeline (default: all)");
  command.option("--from S", options.from_s,
                 "first time to export, seconds since the take's epoch (default: the first frame)");
  command.option("--to S", options.to_s,
                 "last time to export, seconds since the take's epoch (default: the last frame)");
  options.absent = options.default_absent = absent;
  const bool has_choice = times == OfferedTimes::kAll || times == OfferedTimes::kImages;
  options.times = times == OfferedTimes::kAll ? "recorded" : "constant";
  if (has_choice) {
    command
        .option("--times", options.times,
                "recorded: every recorded frame at its own time stamp\n"
                "synchronised: the same, corrected by the clocks of the timeline (raystage sync)\n"
                "constant: one frame per tick of the timeline, or per 1 / --fps\n"
                "(default: " +
                    options.times + ")")
        .one_of({"recorded", "synchronised", "constant"});
    command
        .option("--origin", options.origin,
                "time 0 of the output with recorded and synchronised times: epoch = the take's\n"
                "epoch; first = the first exported frame of all cameras (default: epoch)")
        .one_of({"epoch", "first"});
  }
  if (times == OfferedTimes::kOne) return;
  command
      .option(
          "--fps FPS", options.fps,
          "frames per second of constant times, each shows the nearest tick (default: one frame "
          "per\ntick, at the take's nominal rate if the timeline's is within 0.1 % of it)")
      .range(0.001, 1000.0);
  std::vector<std::string> policies{"hold", "black", "error"};
  std::string help =
      "what stands for an absent frame at constant times: hold = the camera's previous frame,\n"
      "or else its next one; black; error = stop before anything is written";
  if (times == OfferedTimes::kImages) {
    policies.emplace_back("gap");
    help += "; gap = no file";
  }
  command.option("--absent", options.absent, help + " (default: " + absent + ")").one_of(policies);
}

void add_existing_option(CommandLine& command, ExportOptions& options) {
  command.choice("--existing", options.overwrites, {{"error", false}, {"overwrite", true}},
                 "files that exist: error = stop before anything is written; overwrite (default: "
                 "error)");
}

void add_run_options(CommandLine& command, ExportOptions& options) {
  add_threads_option(command, options.threads);
  command.flag("-q,--quiet", options.quiet, "no progress on stderr");
}

exports::FrameChoiceOptions frame_choice(const ExportOptions& options) {
  using exports::AbsentFrames;
  using exports::FrameTimes;
  exports::FrameChoiceOptions choice;
  choice.cameras = options.cameras;
  if (!options.frames.empty()) choice.frames = compose::parse_frame_range(options.frames);
  choice.from_s = options.from_s;
  choice.to_s = options.to_s;
  choice.times = options.times == "constant"       ? FrameTimes::kConstant
                 : options.times == "synchronised" ? FrameTimes::kSynchronised
                                                   : FrameTimes::kRecorded;
  choice.absent = options.absent == "black"   ? AbsentFrames::kBlack
                  : options.absent == "error" ? AbsentFrames::kError
                  : options.absent == "gap"   ? AbsentFrames::kGap
                                              : AbsentFrames::kHold;
  if (choice.times != FrameTimes::kConstant) {
    if (options.fps > 0) {
      throw Error::bad_input("--fps is for constant times", "", "Add --times constant");
    }
    if (options.absent != options.default_absent) {
      throw Error::bad_input("--absent is for constant times: recorded ones have gaps", "",
                             "Add --times constant");
    }
    choice.absent = AbsentFrames::kGap;  // a time stamp says where a frame is
  } else if (options.origin != "epoch") {
    throw Error::bad_input("constant times begin at the first frame", "", "Leave --origin out");
  }
  choice.fps = options.fps;
  choice.starts_at_zero = options.origin == "first";
  return choice;
}

void print_report(const exports::ExportReport& report, const std::string& output,
                  const std::string& what) {
  int absent = 0, held = 0, black = 0, clipped = 0;
  for (const exports::ExportReport::Camera& camera : report.cameras) {
    absent += camera.absent;
    held += camera.held;
    black += camera.black;
    clipped += camera.clipped;
  }
  for (const std::string& note : report.notes) print_error("note: {}\n", note);
  if (clipped > 0) {
    print_error(
        "note: {} frames of more than 8 bits were written with 8 bits, clipped at white; `raystage "
        "export images --format exr` keeps their light\n",
        clipped);
  }
  if (absent > 0) {
    std::string list;
    int listed = 0;
    for (const exports::ExportReport::Camera& camera : report.cameras) {
      if (camera.absent == 0) continue;
      constexpr int kListed = 8;
      if (++listed > kListed) {
        list += ", ...";
        break;
      }
      list += fmt::format("{}{} {}", list.empty() ? "" : ", ", camera.id, camera.absent);
    }
    const char* const replacement = held > 0 && black > 0 ? "others or black stand for them"
                                    : held > 0            ? "others stand for them"
                                    : black > 0           ? "black stands for them"
                                                          : "nothing stands for them";
    print_error("note: {} frames are absent ({}); {}\n", absent, list, replacement);
  }
  if (report.rotten() > 0) {
    print_error(
        "warning: {} stored frames are not as they were recorded (XXH3) and count as absent; "
        "`raystage verify TAKE` lists them\n",
        report.rotten());
  }
  print("{}: {} cameras, {} frames, {}\n", output, report.cameras.size(), report.frames(), what);
}

}  // namespace raystage::cli
