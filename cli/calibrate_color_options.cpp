// SPDX-License-Identifier: Apache-2.0
#include "cli/calibrate_color_options.h"

#include "cli/threads.h"

namespace raystage {
namespace {

void add_scene(CLI::App& app, CalibrateColorOptions& o, CLI::Option* takes, CLI::Option* chart) {
  const char* group = "Without a target";
  CLI::Option* const scene =
      app.add_option(
             "--scene", o.scene,
             "A take of any scene with patterned surfaces: contrast and brightness by which "
             "the cameras agree about the same places of it. Needs a rig that is "
             "calibrated; all else that it knows of colours stays")
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
  depth("--near", o.near, "Nothing is nearer, metres in front of the array (default: the take's)");
  depth("--far", o.far, "Nothing is farther (default: the take's)");
  depth("--focal-depth", o.focal_depth,
        "Only surfaces at this depth count, metres in front of the array, to a tenth of it")
      ->excludes("--near")
      ->excludes("--far");
}

CLI::Option* add_chart(CLI::App& app, CalibrateColorOptions& o) {
  const char* group = "With a colour chart";
  CLI::Option* const chart =
      app.add_option(
             "--chart", o.chart,
             "A take of a ColorChecker Classic that every camera sees, held still: a matrix "
             "for each camera's colours, on top of what targets or else --start tell")
          ->type_name("TAKE")
          ->group(group);
  app.add_flag("--published", o.use_published_values,
               "Colours become what the chart is known to reflect in Rec.709 (default: what the "
               "reference camera shows), as bright as the reference camera shows the greys")
      ->needs(chart)
      ->group(group);
  return chart;
}

void add_target_options(CLI::App& app, CalibrateColorOptions& o, CLI::Option* takes) {
  const char* group = "With targets";
  app.add_option("--dark", o.dark,
                 "Take with capped lenses: light counts from there, and pixels that stand out of "
                 "it are corrected")
      ->type_name("TAKE")
      ->needs(takes)
      ->group(group);
  app.add_option("--exposures", o.exposures,
                 "The takes show one target that does not move, exposed for as long (any unit, one "
                 "number a take): also how each camera's codes follow light, whatever curve it has")
      ->delimiter(',')
      ->check(CLI::Range(1e-9, 1e9).description(""))
      ->type_name("T1,T2,...")
      ->needs(takes)
      ->group(group);
  app.add_flag("--vignetting", o.vignetting,
               "Also the fall of light towards the corners: the brightest target fills every "
               "picture, and is as bright everywhere")
      ->needs(takes)
      ->group(group);
  app.add_flag("--flat-field", o.flat_field,
               "Likewise, as a map of what each part of a picture gains in each channel: also what "
               "no lens explains (filters, shading of a sensor), and any unevenness of the target")
      ->needs(takes)
      ->group(group);
  app.add_flag("--neutral", o.neutral, "White balance: the brightest target becomes grey")
      ->needs(takes)
      ->group(group);
}

}  // namespace

void add_calibrate_color_options(CLI::App& app, CalibrateColorOptions& o) {
  CLI::Option* const takes = app.add_option(
      "TAKE", o.takes,
      "Takes of a target that fills the middle of every picture and is everywhere as "
      "bright, each of another brightness: lens caps, grey, white (one alone tells the "
      "contrast only)");
  app.add_option("-o,--output", o.output,
                 "The rig that is written: --start, with colours found here in place of its own")
      ->required()
      ->type_name("RIG.json");
  app.add_option("--start", o.start, "The rig that gets colours (default: the first take's)")
      ->type_name("RIG.json");
  app.add_option("--reference", o.reference,
                 "Camera that the others are made alike to (default: the first)")
      ->type_name("ID");
  CLI::Option* const chart = add_chart(app, o);
  add_scene(app, o, takes, chart);
  add_target_options(app, o, takes);
  CLI::Option* const sheet =
      app.add_option(
             "--sheet", o.sheet,
             "Contact sheet: what cameras show, as recorded on the left, corrected on the right")
          ->type_name("FILE.jpg");
  app.add_option("--sheet-of", o.sheet_of,
                 "The take that the sheet shows (default: the first that is given)")
      ->type_name("TAKE")
      ->needs(sheet);
  app.add_flag("--force", o.force, "Write the rig even if the calibration is rejected");
  add_threads_option(app, o.threads);
  app.add_flag("--json", o.json, "Print everything found as JSON");
  app.add_flag("-q,--quiet", o.quiet, "No progress on stderr");
}

}  // namespace raystage
