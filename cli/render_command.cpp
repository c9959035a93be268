// SPDX-License-Identifier: Apache-2.0
#include "cli/render_command.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <map>
#include <optional>

#include "base/resources.h"
#include "cli/command_line_parsing.h"
#include "cli/follow_links_option.h"
#include "cli/sandbox_option.h"
#include "cli/shot_options.h"
#include "cli/simd_option.h"
#include "cli/threads.h"
#include "compose/derived_data.h"
#include "compose/frame_range.h"
#include "compose/sequence.h"
#include "compose/shot_plan.h"
#include "planning/shot_check.h"
#include "planning/shot_check_report.h"
#include "raystage_version.h"
#include "render/common/method_options.h"
#include "render/methods.h"

namespace raystage::cli {
namespace {

constexpr double kBytesPerGb = 1e9, kMinMemoryGb = 1e-3, kMaxMemoryGb = 1e5;

}  // namespace

namespace {

void declare_draft_options(CommandLine& command, RenderOptions& options) {
  CommandLine draft = command.group("Drafts (by default to renders/SHOT_LAYER_draft.####.exr)");
  draft.option(
      "--method METHOD", options.method,
      "method of all takes instead of the shot's, without the shot's options of the method "
      "except its\ndepth range");
  draft
      .option("--option NAME=VALUE", options.method_options,
              "option of the method, in addition to those of the shot; repeatable")
      .one_argument();
  draft.option("--scale SCALE", options.scale,
               "size of the pictures relative to the shot's, e.g. 1/4 (default: 1)");
  draft
      .option("--camera-step N", options.camera_step,
              "every n-th row and column of the cameras only (default: 1)")
      .range(1, 64);
  draft
      .option("--layer LAYER", options.layers,
              "layer to show, by its name or its number from 0; repeatable (default: all)")
      .one_argument();
}

compose::DraftOptions draft_of(const RenderOptions& options) {
  compose::DraftOptions draft;
  draft.method = options.method;
  for (const std::string& text : options.method_options) {
    const auto [name, value] = render::option_from_text(text);
    draft.options[name] = value;
  }
  if (!options.scale.empty()) draft.scale = compose::parse_scale(options.scale);
  draft.camera_step = options.camera_step;
  draft.layers = options.layers;
  return draft;
}

}  // namespace

void declare_render_options(CommandLine& command, RenderOptions& options, char** argv) {
  command.option("SHOT", options.shot, "the shot to render (shot.json)").required();
  add_relative_to_option(command, options.relative_to);
  command.option("-o,--output DIR/NAME.####.exr", options.output,
                 "name of the files; #### or %04d is the frame number with that many "
                 "digits\n(default: renders/SHOT_LAYER.####.exr next to the shot; SHOT: its name, "
                 "LAYER: that of its first layer)");
  command.option("--frames RANGE", options.frames,
                 "frames to render, e.g. 1-48, 1-48x2 (every second), 1,5,10-20; frames "
                 "outside\nthe shot are ignored (default: all of the shot)");
  command.choice(
      "--existing", options.existing,
      {{"error", compose::ExistingFiles::kError},
       {"skip", compose::ExistingFiles::kSkip},
       {"overwrite", compose::ExistingFiles::kOverwrite}},
      "frames whose file exists: error = refuse to start; skip = keep complete files made\nfrom "
      "the same inputs, render the others; overwrite = render all (default: error)");
  add_missing_option(command, options.missing);
  command.choice(
      "--rotten", options.rotten,
      {{"error", store::RottenFrames::kError}, {"absent", store::RottenFrames::kAbsent}},
      "cameras whose stored frame is not as it was recorded (its XXH3 differs): error = the frame "
      "fails;\nabsent = render without them, mark the file (lf:rottenCameras), and give exit code "
      "4 (default: absent; under mpirun always an error)");
  command.choice("--fill", options.fill,
                 {{"none", schemas::HoleFill::kNone}, {"push-pull", schemas::HoleFill::kPushPull}},
                 "pixels that no camera saw: none = transparent; push-pull = filled from their "
                 "surroundings;\ncoverage.V still marks them (default: as in the shot)");
  command
      .option("--target-error DB", options.target_error,
              "minimum PSNR, dB: chooses the fastest method and settings that reach it at excluded "
              "cameras,\ninstead of the shot's method (see --methods: auto)")
      .range(1.0, 100.0);
  command
      .option(
          "--target-time S", options.target_time,
          "maximum seconds per frame: chooses the most accurate method and settings within it, or "
          "the\nfastest with --target-error. Predicted for two threads of the machine in "
          "docs/benchmarks.md,\nwith decoded frames, one frame at a time and one sample per pixel")
      .range(1e-6, 1e6);
  command
      .option("--least-coverage SHARE", options.least_coverage,
              "share of the view, 0 to 1, that cameras must see; frames with less are complete, "
              "listed at the\nend, and give exit code 4, also if --existing skip keeps them "
              "(default: 0)")
      .range(0.0, 1.0);
  add_threads_option(command, options.threads);
  add_simd_option(command, options.simd, argv);
  command
      .option("--frames-in-flight N", options.frames_in_flight,
              "frames processed at the same time (default: one per thread, at most 16)")
      .range(1, 256);
  command
      .option("--memory GB", options.memory_gb,
              "memory for frames in flight, decoded source frames, the method's caches and "
              "buffers,\nGB = 10^9 bytes (default: half of the machine's or control group's, at "
              "most 4 GiB of it for\nsource frames)")
      .range(kMinMemoryGb, kMaxMemoryGb);
  command
      .option("--layout LAYOUT", options.layout,
              "parts of the EXR files: standard = one for each layer and view; single = one for "
              "all, for old\nreaders; nuke = as single, with depth as depth.Z (default: as in the "
              "shot, else standard)")
      .one_of_listed({"standard", "single", "nuke"});
  command.option("--ocio CONFIG", options.color_config,
                 "OpenColorIO config for the colours of the files (default: as in the shot, else "
                 "the built-in\none; $OCIO is ignored)");
  add_cache_option(command, options.cache_folder);
  add_follow_links_option(command);
  add_sandbox_option(command);
  command.flag("--chromaticities", options.chromaticities,
               "write the chromaticities attribute for readers that do not know colorInteropID");
  command.flag("--coverage", options.coverage,
               "write channels cameras.V (number of cameras that contribute to a pixel) and "
               "nearest.V\n(distance of the nearest of them from the pixel's ray, metres)");
  command.flag(
      "--confidence", options.confidence,
      "write channel confidence.V: agreement of the cameras near a pixel's ray with it, 0 to 1");
  command.flag("--deep", options.deep,
               "also write NAME.deep.####.exr for each NAME.####.exr: its samples by depth, at "
               "most one of\neach layer");
  add_progress_option(command, options.progress);
  declare_draft_options(command, options);
  command.choice("--missing-archives", options.missing_archives,
                 {{"error", false}, {"absent", true}},
                 "cameras whose archives are missing (under mpirun: that no rank has): error = "
                 "refuse to start;\nabsent = render without them, and mark the files "
                 "(lf:absentCameras; default: error)");
  CommandLine hosts =
      command.group("Archives on several hosts (mpirun raystage render; docs/farm.md)");
  hosts
      .option(
          "--take-folder FROM=TO", options.take_folders,
          "folder TO on a rank for takes below FROM; {rank} and {host} in TO are its number and "
          "host\nname; repeatable, the first match counts (default: the same paths on all hosts)")
      .one_argument();
  hosts
      .option(
          "--fragments", options.fragments,
          "encoding of samples on the network: float = exact, 16 bytes; half = 8 bytes, relative "
          "error\n2^-11; jpeg = about 0.2 bytes, lossy, but half for method depth (default: float)")
      .one_of({"float", "half", "jpeg"});
  hosts.option("--fragment-quality Q", options.jpeg_quality, "JPEG quality (default: 85)")
      .range(1, 100);
  command.option(
      "--fingerprints FILE", options.fingerprints,
      "write the frames' fingerprints to FILE before rendering: lines FRAME FINGERPRINT");
  command.text_flag(
      "--methods", [] { return "Reconstruction methods:" + render::describe_methods(); },
      "list the reconstruction methods with their options and exit");
  command.footer(
      "Exit codes: 0 all requested frames are complete; 1 failed; 2 bad usage or input;\n3 some "
      "frames failed, the rest is done; 4 all frames are complete, but some fall short "
      "(below --least-coverage, or\ncameras with rotten frames are absent); 33 out of memory; "
      "128+n stopped by signal n.");
}

namespace {

/// Reports in one line what the cameras recorded of the frames, if a perspective camera looks at a
/// light field. What cannot be checked is an error of the frames, which report it.
void report_verdict(const compose::ShotPlan& plan, std::span<const compose::PlannedFrame> frames,
                    Progress& progress, const std::stop_token& stop) {
  if (plan.shot_camera().is_equirectangular() || plan.light_fields().empty()) return;
  try {
    progress.say(planning::shot_check_verdict(planning::check_shot(
        plan, plan.shot().name, frames, {.finds_field_of_view = false}, stop)));
  } catch (const Error&) {
  }
}

}  // namespace

ExitCode render(const RenderOptions& options, Progress& progress, render::DistributedTakes* hosts,
                std::string_view hosts_description, std::stop_token stop) {
  const int threads = thread_count(options.threads);
  progress.say(fmt::format(
      "raystage render {} on {}{}: {} threads, simd {}, SHOT {}, --existing {}, frames {}",
      RAYSTAGE_VERSION, host_name(), hosts_description, threads,
      render::simd_level_name(render::kernel_simd_level()), options.shot,
      options.existing == compose::ExistingFiles::kError  ? "error"
      : options.existing == compose::ExistingFiles::kSkip ? "skip"
                                                          : "overwrite",
      options.frames.empty() ? "all" : options.frames));

  compose::SequenceOptions sequence;
  sequence.output = options.output;
  if (!options.frames.empty()) sequence.frames = compose::parse_frame_range(options.frames);
  sequence.existing = options.existing;
  sequence.missing = options.missing;
  sequence.fill = options.fill;
  if (options.target_error > 0) sequence.target["target_error"] = options.target_error;
  if (options.target_time > 0) sequence.target["target_time"] = options.target_time;
  sequence.least_coverage = options.least_coverage;
  sequence.rotten_frames = options.rotten;
  sequence.draft = draft_of(options);
  sequence.frames_in_flight = options.frames_in_flight;
  sequence.memory_bytes = static_cast<std::size_t>(options.memory_gb * kBytesPerGb);
  sequence.layout = options.layout;
  sequence.color_config = options.color_config;
  sequence.cache_folder = options.cache_folder;
  sequence.folder = options.relative_to;
  sequence.chromaticities = options.chromaticities;
  if (options.coverage) sequence.aovs = {"lf.cameras", "lf.nearest"};
  if (options.confidence) sequence.aovs.emplace_back("lf.confidence");
  sequence.deep = options.deep;
  sequence.program_version = RAYSTAGE_VERSION;
  sequence.accepts_missing_archives = options.missing_archives;
  sequence.hosts = hosts;
  sequence.fingerprints_file = options.fingerprints;
  sequence.progress = [&](double done) { progress.report(done); };
  sequence.on_message = [&](std::string_view line) { progress.say(line); };

  sequence.on_plan = [&](const compose::ShotPlan& plan,
                         std::span<const compose::PlannedFrame> frames) {
    report_verdict(plan, frames, progress, stop);
  };

  const ThreadLimit limit(threads);
  tbb::task_arena arena(threads);
  const compose::SequenceReport report =
      arena.execute([&] { return compose::render_sequence(options.shot, sequence, stop); });
  if (report.light_field_frames_estimated + report.light_field_frames_loaded > 0) {
    progress.say(compose::format_stored_data_counts(report.light_field_frames_estimated,
                                                    report.light_field_frames_loaded));
  }
  if (report.rendered > 0) progress.say(report.stages());
  progress.say(report.summary());
  return report.exit_code();
}

}  // namespace raystage::cli
