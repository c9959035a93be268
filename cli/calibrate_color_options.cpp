// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate_color_options.h"

#include "cli/threads.h"

namespace raystage {
namespace {

void add_scene(CLI::App& app, CalibrateColorOptions& o, CLI::Option* takes, CLI::Option* chart) {
  const char* group = "From a scene";
  CLI::Option* const scene =
      app.add_option(
             "--scene", o.settings.scene,
             "A take of any scene with textured surfaces: estimates the contrast and brightness "
             "with which cameras agree about the same surface points. Needs a rig with poses; "
             "keeps the rig's other colour values")
          ->type_name("TAKE")
          ->excludes(takes)
          ->excludes(chart)
          ->group(group);
  const auto depth = [&](const char* name, double& value, const char* what) {
    return app.add_option(name, value, what)
        ->needs(scene)
        ->check(CLI::Range(1e-3, 1e7).description(""))
        ->type_name("METRES")
        ->group(group);
  };
  depth("--near", o.settings.depths.near,
        "Nearest surface, metres in front of the array (default: the take's)");
  depth("--far", o.settings.depths.far,
        "Farthest surface, metres in front of the array (default: the take's)");
  depth("--focal-depth", o.settings.focal_depth,
        "Use only surfaces within 10 % of this depth, metres in front of the array")
      ->excludes("--near")
      ->excludes("--far");
}

CLI::Option* add_chart(CLI::App& app, CalibrateColorOptions& o) {
  const char* group = "From a colour chart";
  CLI::Option* const chart =
      app.add_option(
             "--chart", o.settings.chart,
             "A take of a ColorChecker Classic that every camera sees and that does not move: "
             "estimates a colour matrix for each camera, applied after the response from "
             "targets or --initial-rig")
          ->type_name("TAKE")
          ->group(group);
  app.add_flag("--reference-values", o.settings.use_published_values,
               "Match the published Rec.709 colours of the chart (default: those of the reference "
               "camera), at the brightness with which the reference camera shows its greys")
      ->needs(chart)
      ->group(group);
  return chart;
}

void add_target_options(CLI::App& app, CalibrateColorOptions& o, CLI::Option* takes) {
  const char* group = "From flat targets";
  app.add_option("--dark", o.settings.dark,
                 "Dark frames: a take with capped lenses. Sets the black level and the hot pixels")
      ->type_name("TAKE")
      ->needs(takes)
      ->group(group);
  app.add_option(
         "--exposures", o.settings.exposures,
         "Exposure of each take (any unit, comma separated), if all show one target that does "
         "not move: also estimates the response curve of each camera")
      ->delimiter(',')
      ->check(CLI::Range(1e-9, 1e9).description(""))
      ->type_name("T1,T2,...")
      ->needs(takes)
      ->group(group);
  app.add_flag(
         "--vignetting", o.settings.vignetting,
         "Also fit vignetting: the brightest target must fill every picture and be evenly bright")
      ->needs(takes)
      ->group(group);
  app.add_flag(
         "--flat-field", o.settings.flat_field,
         "Also fit a gain map per channel for what vignetting does not explain (filters, sensor "
         "shading); it includes any unevenness of the target")
      ->needs(takes)
      ->group(group);
  app.add_flag("--neutral", o.settings.neutral, "White balance: makes the brightest target grey")
      ->needs(takes)
      ->group(group);
}

}  // namespace

void add_calibrate_color_options(CLI::App& app, CalibrateColorOptions& o) {
  CLI::Option* const takes = app.add_option(
      "TAKE", o.settings.targets,
      "Takes of an evenly bright target that fills the middle of every picture, each of "
      "another brightness: lens caps, grey, white (one take alone determines the contrast "
      "only)");
  app.add_option("-o,--output", o.output,
                 "The rig to write: --initial-rig with the estimated colour responses")
      ->required()
      ->type_name("RIG.json");
  app.add_option("--initial-rig", o.start, "The rig to start from (default: the first take's)")
      ->type_name("RIG.json");
  app.add_option("--reference", o.settings.reference,
                 "Id of the camera that the others are matched to (default: the first)")
      ->type_name("ID");
  CLI::Option* const chart = add_chart(app, o);
  add_scene(app, o, takes, chart);
  add_target_options(app, o, takes);
  CLI::Option* const sheet =
      app.add_option(
             "--contact-sheet", o.sheet,
             "Contact sheet: each camera's picture as recorded (left) and corrected (right)")
          ->type_name("FILE.jpg");
  app.add_option("--contact-sheet-take", o.sheet_of,
                 "The take that the sheet shows (default: the first given)")
      ->type_name("TAKE")
      ->needs(sheet);
  app.add_flag("--force", o.force, "Write the rig even if the calibration is rejected");
  add_threads_option(app, o.threads);
  app.add_flag("--json", o.json, "Print the results as JSON");
  app.add_flag("-q,--quiet", o.quiet, "No progress on stderr");
}

}  // namespace raystage
