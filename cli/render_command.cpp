// SPDX-License-Identifier: Apache-2.0
#include "cli/render_command.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <array>
#include <map>
#include <optional>

#include "cli/choice_option.h"
#include "cli/command_line_parsing.h"
#include "cli/shot_options.h"
#include "cli/simd_option.h"
#include "cli/threads.h"
#include "compose/derived_data.h"
#include "compose/frame_range.h"
#include "compose/sequence.h"
#include "raystage_version.h"
#include "render/methods.h"

namespace raystage {
namespace {

constexpr double kBytesPerGb = 1e9, kLeastMemoryGb = 1e-3, kMostMemoryGb = 1e5;

}  // namespace

void declare_render_options(CLI::App& app, RenderOptions& options, char** argv) {
  app.add_option("SHOT", options.shot, "the shot to render (shot.json)")->required();
  add_relative_to_option(app, options.relative_to);
  app.add_option("-o,--output", options.output,
                 "name of the frames; #### is the frame number with that many digits, as is %04d\n"
                 "(default: renders/SHOT_LAYER.####.exr beside the shot)")
      ->type_name("DIR/NAME.####.exr");
  app.add_option("--frames", options.frames,
                 "frames to render, e.g. 1-48, 1-48x2 (every second), 1,5,10-20; frames outside\n"
                 "the shot are left out (default: all of the shot)")
      ->type_name("RANGE");
  add_choice<ExistingFiles>(app, "--existing", options.existing,
                            {{"error", ExistingFiles::kError},
                             {"skip", ExistingFiles::kSkip},
                             {"overwrite", ExistingFiles::kOverwrite}},
                            "frames whose file is there: error = refuse to start; skip = keep a "
                            "file that is\nwhole and was made from the same inputs, render the "
                            "others; overwrite = render all\n(default: error)");
  add_missing_option(app, options.missing);
  add_choice<std::optional<HoleFill>>(
      app, "--fill", options.fill, {{"none", HoleFill::kNone}, {"push-pull", HoleFill::kPushPull}},
      "rays that no camera saw: none = transparent; push-pull = coloured from what was seen "
      "around\nthem; lf.coverage still shows them (default: what the shot says)");
  app.add_option("--target-error", options.target_error,
                 "let raystage choose the cheapest method and settings whose error, measured at "
                 "cameras left out,\nis at least this PSNR, dB; in place of the shot's method (see "
                 "--methods: auto)")
      ->check(CLI::Range(1.0, 100.0))
      ->type_name("DB");
  app.add_option("--target-time", options.target_time,
                 "the same for the most accurate that takes at most this long for a frame, seconds "
                 "on two threads\nof the machine of docs/benchmarks.md, to be rendered alone from "
                 "decoded frames, one sample a\npixel; with --target-error the cheapest within it")
      ->check(CLI::Range(1e-6, 1e6))
      ->type_name("S");
  add_threads_option(app, options.threads);
  add_simd_option(app, options.simd, argv);
  app.add_option("--frames-in-flight", options.frames_in_flight,
                 "frames worked on at once (default: one per thread, at most 16)")
      ->check(CLI::Range(1, 256))
      ->type_name("N");
  app.add_option("--memory", options.memory_gb,
                 "memory for frames in flight, decoded source frames and what the method keeps and "
                 "works\nwith, GB = 10^9 bytes "
                 "(default: half of the machine's or control group's; at most 4 GiB of source "
                 "frames)")
      ->check(CLI::Range(kLeastMemoryGb, kMostMemoryGb))
      ->type_name("GB");
  app.add_option(
         "--layout", options.layout,
         "how layers and views are spread over an EXR file: standard = a part for each; "
         "single = all\nin one part, for old readers; nuke = the same with depth as depth.Z "
         "(default: what the shot\nsays, else standard)")
      ->check(CLI::IsMember({"standard", "single", "nuke"}))
      ->type_name("LAYOUT");
  app.add_option("--ocio", options.color_config,
                 "OpenColorIO config for the colours of the files (default: what the shot says, "
                 "else the\nbuilt-in one; $OCIO is not looked at)")
      ->type_name("CONFIG");
  add_cache_option(app, options.cache_folder);
  app.add_flag("--chromaticities", options.chromaticities,
               "write the chromaticities attribute for readers that do not know colorInteropID");
  app.add_flag(
      "--coverage", options.coverage,
      "write channels lf.cameras (how many cameras are behind a pixel) and lf.nearest (how near\n"
      "the nearest of them passes to its ray, metres)");
  app.add_flag(
      "--confidence", options.confidence,
      "write channel lf.confidence: how far the cameras about a pixel's ray agree with it, 0 to 1");
  app.add_flag(
      "--deep", options.deep,
      "beside each file NAME.####.exr write NAME.deep.####.exr: the samples it is made of, "
      "by depth,\none of each layer at most");
  add_progress_option(app, options.progress);
  const char* const of_hosts = "Archives on several hosts (mpirun raystage render; docs/farm.md)";
  app.add_option("--take-folder", options.take_folders,
                 "where a rank keeps the folders of takes below FROM; {rank} and {host} in TO are "
                 "its number and\nhost name; repeatable, the first that fits counts (default: the "
                 "same paths on all hosts)")
      ->type_name("FROM=TO")
      ->take_all()
      ->allow_extra_args(false)
      ->group(of_hosts);
  add_choice<bool>(app, "--missing-archives", options.missing_archives,
                   {{"error", false}, {"absent", true}},
                   "cameras whose archives no rank has: error = refuse to start; absent = render "
                   "without them and\nmark what is missing (default: error)")
      ->group(of_hosts);
  app.add_option("--fragments", options.fragments,
                 "how samples cross the network: float = exact, 16 bytes; half = 8 bytes, each "
                 "value to 2^-11 of it;\njpeg = about a fifth of a byte, lossy; half for method "
                 "depth (default: float)")
      ->check(CLI::IsMember({"float", "half", "jpeg"}).description(""))
      ->type_name("float|half|jpeg")
      ->group(of_hosts);
  app.add_option("--fragment-quality", options.jpeg_quality,
                 "JPEG quality of fragments, 1 to 100 (default: 85)")
      ->check(CLI::Range(1, 100))
      ->type_name("Q")
      ->group(of_hosts);
  app.add_option("--fingerprints", options.fingerprints,
                 "write the fingerprint of each frame to FILE, before the first is rendered: lines "
                 "FRAME FINGERPRINT")
      ->type_name("FILE");
  // Printed as the version is: at once, whatever else is missing.
  app.add_flag_callback(
      "--methods",
      [] { throw CLI::CallForVersion("Reconstruction methods:" + describe_methods(), 0); },
      "list the reconstruction methods, with the options of each, and exit");
  app.footer(
      "Exit codes: 0 every frame asked for is there, whole; 1 failed; 2 bad usage or input;\n"
      "3 some frames failed, the rest is done; 33 out of memory; 128+n stopped by signal n.");
}

namespace {

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
}

}  // namespace

ExitCode render(const RenderOptions& options, Progress& progress, DistributedTakes* hosts,
                std::string_view hosts_description, std::stop_token stop) {
  const int threads = thread_count(options.threads);
  progress.say(fmt::format(
      "raystage render {} on {}{}: {} threads, simd {}, SHOT {}, --existing {}, frames {}",
      RAYSTAGE_VERSION, host_name(), hosts_description, threads,
      simd_level_name(kernel_simd_level()), options.shot,
      options.existing == ExistingFiles::kError  ? "error"
      : options.existing == ExistingFiles::kSkip ? "skip"
                                                 : "overwrite",
      options.frames.empty() ? "all" : options.frames));

  SequenceOptions sequence;
  sequence.output = options.output;
  if (!options.frames.empty()) sequence.frames = parse_frame_range(options.frames);
  sequence.existing = options.existing;
  sequence.missing = options.missing;
  sequence.fill = options.fill;
  if (options.target_error > 0) sequence.target["target_error"] = options.target_error;
  if (options.target_time > 0) sequence.target["target_time"] = options.target_time;
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
  sequence.hosts = hosts;
  sequence.fingerprints_file = options.fingerprints;
  sequence.progress = [&](double done) { progress.report(done); };
  sequence.on_message = [&](std::string_view line) { progress.say(line); };

  const ThreadLimit limit(threads);
  tbb::task_arena arena(threads);
  const SequenceReport report =
      arena.execute([&] { return render_sequence(options.shot, sequence, stop); });
  if (report.light_field_frames_estimated + report.light_field_frames_loaded > 0) {
    progress.say(format_stored_data_counts(report.light_field_frames_estimated,
                                           report.light_field_frames_loaded));
  }
  if (report.rendered > 0) progress.say(report.stages());
  progress.say(report.summary());
  return report.exit_code();
}

}  // namespace raystage
