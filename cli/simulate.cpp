// SPDX-License-Identifier: Apache-2.0
// raystage simulate: simulates a take with ground truth.
#include "simulate/simulate.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "base/error.h"
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "raystage_version.h"
#include "schemas/projection_names.h"
#include "schemas/rig_document.h"
#include "simulate/scene.h"

namespace {

using namespace raystage;
using namespace raystage::cli;

struct Options {
  simulate::SimulationOptions settings;
  std::string output, calibration = "true", chroma = "444", rig;
  std::optional<double> k1, k2;
  double spacing_mm = 60, mounting_mm = 3, jitter_ms = 0.2, clock_offset_ms = 5;
  std::vector<double> spheres;  ///< x, y, z and radius of each
  int threads = 0;
  int bits = 0;  ///< 0: 16 of an HDR scene, else 8
  bool no_restart_markers = false, quiet = false;
};

void add_array_options(CommandLine command, Options& o) {
  simulate::SimulationOptions& s = o.settings;
  command.option("--rows", s.rows, "Rows of cameras, 1-100");
  command.option("--columns", s.columns, "Columns of cameras, 1-100");
  command.option("--spacing-mm", o.spacing_mm,
                 "Distance between adjacent cameras, millimetres, 0-10000");
  command.option("--position X,Y,Z", s.position, "Centre of the array, metres (default: 0,0,0)")
      .comma_separated();
  command.option("--rotation-deg", s.turn_deg,
                 "Rotation of the array about the vertical axis, counter-clockwise from above, "
                 "degrees, -360 to 360; 0 = viewing direction -z");
  std::map<std::string, schemas::Projection> lenses;
  for (const schemas::Projection projection : schemas::projections()) {
    lenses[std::string(schemas::name_of(projection))] = projection;
  }
  command.choice("--lens", s.lens, lenses,
                 "Projection of the lenses; fisheye (OpenCV's) and ftheta are alike "
                 "(default: pinhole)");
  command.option("--fov-deg", s.horizontal_fov_deg,
                 "Horizontal field of view without distortion, full angle, degrees, 1-150; "
                 "orthographic up to 180, other fisheyes up to 300");
  command.option("--width", s.width, "Width of a frame, pixels, 1-16384");
  command.option("--height", s.height, "Height of a frame, pixels, 1-16384");
  command.option("--k1", o.k1,
                 "Radial distortion: factor of r^3, -10 to 10 (default: -0.2, of fisheyes 0)");
  command.option("--k2", o.k2,
                 "Radial distortion: factor of r^5, -10 to 10 (default: 0.05, of fisheyes 0)");
  command.option("--lens-deviation", s.lens_deviation,
                 "Standard deviation of the lenses: 1 = focal length 0.3 %, principal point 0.6 % "
                 "of the width, k1 and k2 0.01; 0-10");
  command.option("--mounting-mm", o.mounting_mm,
                 "Maximum error of a camera's position, millimetres, 0-1000");
  command.option("--mounting-deg", s.mounting_error_deg,
                 "Maximum error of a camera's direction, degrees, 0-45");
  command.option("--photometric", s.photometric_deviation,
                 "Standard deviation of the cameras' contrast per channel, 0-0.2");
  simulate::ColorErrors& errors = s.color_errors;
  command.option("--gain", errors.gain, "Maximum deviation of a camera's gain from 1, 0-0.9");
  command.option("--white-balance", errors.white_balance,
                 "Maximum deviation of the gain of red and blue relative to green from 1, 0-0.9");
  command.option("--offset", errors.offset,
                 "Maximum light added to a channel, full scale 1, 0-0.5");
  command.option("--vignetting", errors.vignetting,
                 "Maximum fraction of light that a lens loses in the corner, 0-0.9");
  command.option("--color-mix", errors.crosstalk,
                 "Maximum fraction of each other channel's light in a channel, 0-0.3");
  command.option("--curve", errors.curve,
                 "Maximum deviation of the response's exponent from 1, 0-0.5");
  command.option("--hot-pixels", errors.hot_pixels, "Hot pixels of a camera, 0-20000");
  Option rig = command.option("--rig FILE", o.rig,
                              "Cameras of a rig.json instead of a grid, relative to the position "
                              "and rotation of the array; "
                              "their pictures are scaled to the width");
  for (const char* of_grid :
       {"--rows", "--columns", "--spacing-mm", "--fov-deg", "--height", "--lens", "--k1", "--k2"}) {
    rig.excludes(of_grid);
  }
  command.option("--calibration TEXT", o.calibration, "Calibration in rig.json; nominal: design")
      .one_of_listed({"true", "nominal"});
}

void add_time_options(CommandLine command, Options& o) {
  simulate::SimulationOptions& s = o.settings;
  command.option("--fps", s.fps, "Frames per second of each camera, 0.1-1000");
  command.option("--seconds", s.seconds,
                 "Duration of the take, seconds, at least one frame, at most 36000");
  command.option("--period-ppm", s.period_error_ppm,
                 "Standard deviation of the cameras' frame rates, ppm, 0-1000");
  command.option("--jitter-ms", o.jitter_ms,
                 "Standard deviation of exposure times, milliseconds, at most 5 % of a frame time");
  command.option("--clock-offset-ms", o.clock_offset_ms,
                 "Maximum offset of a node's clock, milliseconds, 0-10000");
  command.option("--cameras-per-node", s.cameras_per_node,
                 "Cameras of a node, which share a clock, 1-10000");
  command.option("--startup-loss-seconds", s.startup_loss_s,
                 "Frames before this time are dropped, seconds, at most the take's duration");
  command.option("--drop", s.drop_probability, "Probability that a later frame is dropped, 0-0.99");
  command.option("--line-time-us", s.line_time_us,
                 "Rolling shutter: time from the exposure of a row to that of the row below, "
                 "microseconds; negative = from the bottom up; 0 = global shutter. The rows of a "
                 "frame take at most a frame time (default: the line times of --rig, scaled so "
                 "that read-outs take as long; otherwise 0)");
}

void add_picture_options(CommandLine command, Options& o) {
  simulate::SimulationOptions& s = o.settings;
  command.flag(
      "--hdr", s.hdr,
      "Lamps 64 times as bright as white, so that the stage spans about 14 stops. Frames are "
      "half floats as JPEG XL, and truth/VIEW.light.exr holds the linear light of views");
  command
      .option("--bits N", o.bits,
              "Bits of a sample: 8 = JPEG, clipped at white; 16 = half floats as JPEG XL; "
              "0 = 16 with --hdr, otherwise 8")
      .one_of_listed({"0", "8", "16"});
  command.option("--noise", s.noise,
                 "Standard deviation of sensor noise at full scale 1, proportional to the square "
                 "root of the light, 0-1");
  command.option("--edge-samples", s.edge_samples, "Samples per pixel at edges: 1, 4, 9, ... 256");
  command.option("--quality", s.jpeg.quality, "JPEG quality, 1-100").range(1, 100);
  command.option("--chroma TEXT", o.chroma, "JPEG chroma sampling")
      .one_of_listed({"444", "422", "420"});
  command.flag("--no-restart-markers", o.no_restart_markers,
               "Write JPEG without restart markers: frames can only be decoded as a whole");
  command.option("--truth-views", s.truth_views,
                 "Noise-free views along the virtual camera path, 0-10000");
  command.option("--truth-width", s.truth_width,
                 "Width of a view, pixels, at most 16384; 0 = as the cameras");
  command.option("--truth-height", s.truth_height,
                 "Height of a view, pixels, at most 16384; 0 = as the cameras");
  command.option("--truth-samples", s.truth_samples,
                 "Samples per pixel of a view: 1, 4, 9, 16, ... 256");
  command
      .option("--truth-spheres X,Y,Z,RADIUS", o.spheres,
              "Adds unlit balls to the views, not to the cameras' frames, to measure composites: "
              "four numbers for each, world, metres")
      .comma_separated();
  command.option("--truth-shutter-deg", s.truth_shutter_deg,
                 "Shutter angle of the views and of the camera of shot.json, degrees, 0-360; the "
                 "exposures of the array's cameras are instants");
  command.flag(
      "--camera-depths", s.camera_depths,
      "Write the true planar depths of the cameras' frames: truth/depths/CAMERA/000001.exr "
      "is the first recorded frame, for raystage import --depth-numbers recorded");
  command.option("--shot-frames", s.shot_frames, "Frames of shot.json, 1-1000000");
}

ExitCode run(Options& o, std::stop_token stop) {
  simulate::SimulationOptions& s = o.settings;
  if (o.spheres.size() % 4 != 0) {
    throw Error::bad_input(fmt::format("found {} numbers for spheres", o.spheres.size()),
                           "--truth-spheres", "Give four for each: x, y, z and the radius");
  }
  for (std::size_t i = 0; i < o.spheres.size(); i += 4) {
    s.truth_spheres.push_back({o.spheres[i], o.spheres[i + 1], o.spheres[i + 2], o.spheres[i + 3]});
  }
  s.spacing = o.spacing_mm / 1000;
  if (s.lens != schemas::Projection::kPinhole) s.k1 = s.k2 = 0;
  s.k1 = o.k1.value_or(s.k1);
  s.k2 = o.k2.value_or(s.k2);
  if (!o.rig.empty()) s.given_rig = schemas::read_rig(std::filesystem::path(o.rig));
  s.mounting_error = o.mounting_mm / 1000;
  s.jitter = o.jitter_ms / 1000;
  s.clock_offset = o.clock_offset_ms / 1000;
  s.nominal_calibration = o.calibration == "nominal";
  s.records_half = o.bits == 16 || (o.bits == 0 && s.hdr);
  s.jpeg.restart_interval = o.no_restart_markers ? 0 : -1;
  using Chroma = store::JpegEncodeOptions::Chroma;
  s.jpeg.chroma = o.chroma == "420"   ? Chroma::k420
                  : o.chroma == "422" ? Chroma::k422
                                      : Chroma::k444;
  const ThreadLimit limit(o.threads);
  Progress progress(!o.quiet);
  const simulate::SimulationReport report = simulate::simulate(
      s, o.output, "raystage " RAYSTAGE_VERSION, [&](double done) { progress.report(done); }, stop);
  print("{}: {} cameras, {} frames, {} missing, {} ground truth views\n", o.output, report.cameras,
        report.frames_stored, report.frames_missing, report.truth_views);
  record_event(o.output, "creation", "simulate",
               fmt::format("{} cameras, {} frames", report.cameras, report.frames_stored));
  return ExitCode::kSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine command("Simulates a take with ground truth: views.json, shot.json, truth.json.",
                      "raystage simulate");
  std::string scenes = "Scene:";
  for (const auto& [name, summary] : simulate::scene_names()) {
    scenes += fmt::format(" {} ({});", name, summary);
  }
  scenes.pop_back();
  command.show_defaults();
  command.option("SCENE", o.settings.scene, scenes);
  command.option("-o,--output TAKE", o.output, "Folder of the new take").required();
  command
      .option("--seed", o.settings.seed,
              "Seed of the random numbers, 0 or more; the same seed gives the same bytes")
      .check([](const std::string& text) {
        return text.starts_with("-") ? "found " + text + ", allowed: 0 or more" : std::string();
      });
  add_threads_option(command, o.threads);
  command.flag("-q,--quiet", o.quiet, "No progress on stderr");
  add_array_options(command.group("Array"), o);
  add_time_options(command.group("Time"), o);
  add_picture_options(command.group("Pictures and truth"), o);
  return parse_and_run(command, argc, argv, "simulate",
                       [&](std::stop_token stop) { return run(o, stop); }, OnSignal::kAbort,
                       {{"--turn-deg", "--rotation-deg"}});
}
