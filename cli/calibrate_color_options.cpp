// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate_color_options.h"

#include "cli/follow_links_option.h"
#include "cli/threads.h"

namespace raystage::cli {
namespace {

void add_scene(CommandLine command, CalibrateColorOptions& o) {
  command
      .option("--scene TAKE", o.settings.scene,
              "A take of any scene with textured surfaces: estimates the contrast and brightness "
              "with which cameras agree about the same surface points. Needs a rig with poses; "
              "keeps the rig's other colour values")
      .excludes("TAKE")
      .excludes("--chart");
  const auto depth = [&](const char* name, double& value, const char* what) {
    return command.option(name, value, what).needs("--scene").limits(1e-3, 1e7);
  };
  depth("--near METRES", o.settings.depths.near,
        "Nearest surface, metres in front of the array (default: the take's)");
  depth("--far METRES", o.settings.depths.far,
        "Farthest surface, metres in front of the array (default: the take's)");
  depth("--focal-depth METRES", o.settings.focal_depth,
        "Use only surfaces within 10 % of this depth, metres in front of the array")
      .excludes("--near")
      .excludes("--far");
}

void add_chart(CommandLine command, CalibrateColorOptions& o) {
  command.option(
      "--chart TAKE", o.settings.chart,
      "A take of a ColorChecker Classic that every camera sees and that does not move: estimates a "
      "colour matrix for each camera, applied after the response from targets or --initial-rig");
  command
      .flag("--reference-values", o.settings.use_published_values,
            "Match the published Rec.709 colours of the chart (default: those of the reference "
            "camera), at the brightness with which the reference camera shows its greys")
      .needs("--chart");
}

void add_target_options(CommandLine command, CalibrateColorOptions& o) {
  command
      .option("--dark TAKE", o.settings.dark,
              "Dark frames: a take with capped lenses. Sets the black level and the hot pixels")
      .needs("TAKE");
  command
      .option("--exposures T1,T2,...", o.settings.exposures,
              "Exposure of each take (any unit, comma separated), if all show one target that does "
              "not move: also estimates the response curve of each camera")
      .comma_separated()
      .limits(1e-9, 1e9)
      .needs("TAKE");
  command
      .flag(
          "--vignetting", o.settings.vignetting,
          "Also fit vignetting: the brightest target must fill every picture and be evenly bright")
      .needs("TAKE");
  command
      .flag("--flat-field", o.settings.flat_field,
            "Also fit a gain map per channel for what vignetting does not explain (filters, sensor "
            "shading); it includes any unevenness of the target")
      .needs("TAKE");
  command.flag("--neutral", o.settings.neutral, "White balance: makes the brightest target grey")
      .needs("TAKE");
}

}  // namespace

void add_calibrate_color_options(CommandLine& command, CalibrateColorOptions& o) {
  command.option(
      "TAKE", o.settings.targets,
      "Takes of an evenly bright target that fills the middle of every picture, each of another "
      "brightness: lens caps, grey, white (one take alone determines the contrast only)");
  command.option("-o,--output RIG.json", o.output, "Rig to write: the initial rig with new colours")
      .required();
  command.option("--initial-rig RIG.json", o.start,
                 "The rig to start from (default: the first take's)");
  command.option("--reference ID", o.settings.reference,
                 "Id of the camera that the others are matched to (default: the first)");
  add_chart(command.group("From a colour chart"), o);
  add_scene(command.group("From a scene"), o);
  add_target_options(command.group("From flat targets"), o);
  command.option("--contact-sheet FILE.jpg", o.sheet,
                 "Contact sheet: each camera's picture as recorded (left) and corrected (right)");
  command.option("--contact-sheet-take TAKE", o.sheet_of, "Take shown (default: the first given)")
      .needs("--contact-sheet");
  command.flag("--force", o.force, "Write the rig even if the calibration is rejected");
  add_threads_option(command, o.threads);
  command.flag("--json", o.json, "Print the results as JSON");
  add_follow_links_option(command);
  command.flag("-q,--quiet", o.quiet, "No progress on stderr");
}

}  // namespace raystage::cli
