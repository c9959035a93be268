// SPDX-License-Identifier: Apache-2.0
#include "simulate/simulate.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/threads.h"
#include "raystage_version.h"
#include "simulate/scene.h"

namespace {

struct Options {
  raystage::SimulationSettings settings;
  std::string output, calibration = "true", chroma = "444";
  double spacing_mm = 60, mounting_mm = 3, jitter_ms = 0.2, clock_offset_ms = 5;
  int threads = 0;
  bool no_restart_markers = false, quiet = false;
};

void add_array_options(CLI::App& app, Options& o) {
  raystage::SimulationSettings& s = o.settings;
  const char* group = "Array";
  app.add_option("--rows", s.rows, "Rows of cameras, 1-100")->group(group);
  app.add_option("--columns", s.columns, "Columns of cameras, 1-100")->group(group);
  app.add_option("--spacing-mm", o.spacing_mm, "Distance between neighbours, millimetres, 0-10000")
      ->group(group);
  app.add_option("--position", s.position,
                 "Middle of the array in the scene, metres: X,Y,Z (default: 0,0,0)")
      ->delimiter(',')
      ->type_name("X,Y,Z")
      ->group(group);
  app.add_option("--rotation-deg", s.turn_deg,
                 "Turn of the array about the vertical, counter-clockwise from above, degrees, "
                 "-360 to 360; 0: it looks down -z")
      ->group(group);
  app.add_option("--fov-deg", s.horizontal_fov_deg,
                 "Horizontal field of view without distortion, full angle, degrees, 1-150")
      ->group(group);
  app.add_option("--width", s.width, "Width of a frame, pixels, 1-16384")->group(group);
  app.add_option("--height", s.height, "Height of a frame, pixels, 1-16384")->group(group);
  app.add_option("--k1", s.k1, "Radial distortion, r^2, -10 to 10")->group(group);
  app.add_option("--k2", s.k2, "Radial distortion, r^4, -10 to 10")->group(group);
  app.add_option("--lens-deviation", s.lens_deviation,
                 "How much lenses differ: 1 = focal length 0.3 %, principal point 0.6 % of the "
                 "width, k1 and k2 0.01 (one sigma); 0 = not at all, at most 10")
      ->group(group);
  app.add_option("--mounting-mm", o.mounting_mm,
                 "Largest error of a camera's place, millimetres, 0-1000")
      ->group(group);
  app.add_option("--mounting-deg", s.mounting_error_deg,
                 "Largest error of a camera's direction, degrees, 0-45")
      ->group(group);
  app.add_option("--photometric", s.photometric_deviation,
                 "How much the cameras' contrast differs per channel, one sigma, 0-0.2")
      ->group(group);
  raystage::ColorErrors& errors = s.color_errors;
  app.add_option("--gain", errors.gain, "Gain of a camera: 1 +- this at most, 0-0.9")->group(group);
  app.add_option("--white-balance", errors.white_balance,
                 "Gain of red and blue beside green: 1 +- this at most, 0-0.9")
      ->group(group);
  app.add_option("--offset", errors.offset,
                 "Light added to a channel, full scale 1: this at most, 0-0.5")
      ->group(group);
  app.add_option("--vignetting", errors.vignetting,
                 "Share of light that a lens loses in the corner, at most, 0-0.9")
      ->group(group);
  app.add_option("--color-mix", errors.crosstalk,
                 "Share of each other channel's light in a channel, at most, 0-0.3")
      ->group(group);
  app.add_option("--curve", errors.curve,
                 "Codes are raised to the power of 1 +- this at most, 0-0.5")
      ->group(group);
  app.add_option("--hot-pixels", errors.hot_pixels,
                 "Pixels of a camera that show light in the dark, 0-20000")
      ->group(group);
  app.add_option("--calibration", o.calibration,
                 "What rig.json holds: the true calibration or the design (nominal)")
      ->check(CLI::IsMember({"true", "nominal"}))
      ->group(group);
}

void add_time_options(CLI::App& app, Options& o) {
  raystage::SimulationSettings& s = o.settings;
  const char* group = "Time";
  app.add_option("--fps", s.fps, "Frames per second of each camera, 0.1-1000")->group(group);
  app.add_option("--seconds", s.seconds,
                 "Length of the take, seconds, at least one frame, at most 36000")
      ->group(group);
  app.add_option("--period-ppm", s.period_error_ppm,
                 "Error of each camera's own rate, millionths, one sigma, 0-1000")
      ->group(group);
  app.add_option("--jitter-ms", o.jitter_ms,
                 "Jitter of an exposure, milliseconds, one sigma, at most 5 % of a frame time")
      ->group(group);
  app.add_option("--clock-offset-ms", o.clock_offset_ms,
                 "Largest error of a node's clock, milliseconds, 0-10000")
      ->group(group);
  app.add_option("--cameras-per-node", s.cameras_per_node,
                 "Cameras whose frames one clock stamps, 1-10000")
      ->group(group);
  app.add_option("--startup-loss-seconds", s.startup_loss_s,
                 "Frames before this are lost, seconds, at most the take")
      ->group(group);
  app.add_option("--drop", s.drop_probability, "Probability that a later frame is lost, 0-0.99")
      ->group(group);
}

void add_picture_options(CLI::App& app, Options& o) {
  raystage::SimulationSettings& s = o.settings;
  const char* group = "Pictures and truth";
  app.add_option("--noise", s.noise,
                 "Sensor noise at full scale, one sigma, full scale 1; falls with the root of the "
                 "light; 0-1")
      ->group(group);
  app.add_option("--edge-samples", s.edge_samples, "Samples of a pixel at edges: 1, 4, 9, ... 256")
      ->group(group);
  app.add_option("--quality", s.jpeg.quality, "JPEG quality, 1-100")
      ->check(CLI::Range(1, 100))
      ->group(group);
  app.add_option("--chroma", o.chroma, "JPEG chroma sampling")
      ->check(CLI::IsMember({"444", "422", "420"}))
      ->group(group);
  app.add_flag("--no-restart-markers", o.no_restart_markers,
               "Write plain JPEG: whole frames must then be decoded")
      ->group(group);
  app.add_option("--truth-views", s.truth_views, "Noise-free views along the virtual path, 0-10000")
      ->group(group);
  app.add_option("--truth-width", s.truth_width,
                 "Width of a view, pixels, at most 16384; 0 = as the cameras")
      ->group(group);
  app.add_option("--truth-height", s.truth_height,
                 "Height of a view, pixels, at most 16384; 0 = as the cameras")
      ->group(group);
  app.add_option("--truth-samples", s.truth_samples,
                 "Samples of a view's pixel: 1, 4, 9, 16, ... 256")
      ->group(group);
  app.add_option("--shot-frames", s.shot_frames, "Frames of shot.json, 1-1000000")->group(group);
}

raystage::ExitCode run(Options& o, std::stop_token stop) {
  raystage::SimulationSettings& s = o.settings;
  s.spacing = o.spacing_mm / 1000;
  s.mounting_error = o.mounting_mm / 1000;
  s.jitter = o.jitter_ms / 1000;
  s.clock_offset = o.clock_offset_ms / 1000;
  s.nominal_calibration = o.calibration == "nominal";
  s.jpeg.restart_interval = o.no_restart_markers ? 0 : -1;
  using Chroma = raystage::JpegEncodeSettings::Chroma;
  s.jpeg.chroma = o.chroma == "420"   ? Chroma::k420
                  : o.chroma == "422" ? Chroma::k422
                                      : Chroma::k444;
  const raystage::ThreadLimit limit(o.threads);
  raystage::Progress progress(!o.quiet);
  const raystage::SimulationReport report = raystage::simulate(
      s, o.output, "raystage " RAYSTAGE_VERSION, [&](double done) { progress.report(done); }, stop);
  fmt::print("{}: {} cameras, {} frames, {} missing, {} true views\n", o.output, report.cameras,
             report.frames_stored, report.frames_missing, report.truth_views);
  return raystage::ExitCode::kSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CLI::App app("Simulates a take with known truth: views.json, shot.json, truth.json.",
               "raystage simulate");
  std::string scenes = "Scene:";
  for (const auto& [name, summary] : raystage::scene_names()) {
    scenes += fmt::format(" {} ({});", name, summary);
  }
  scenes.pop_back();
  app.option_defaults()->always_capture_default();
  app.add_option("SCENE", o.settings.scene, scenes);
  app.add_option("-o,--output", o.output, "Folder of the new take")->required()->type_name("TAKE");
  app.add_option("--seed", o.settings.seed, "Same seed, same bytes; 0 or more")
      ->check([](const std::string& text) {
        return text.starts_with("-") ? "found " + text + ", allowed: 0 or more" : std::string();
      });
  raystage::add_threads_option(app, o.threads);
  app.add_flag("-q,--quiet", o.quiet, "No progress on stderr");
  add_array_options(app, o);
  add_time_options(app, o);
  add_picture_options(app, o);
  return raystage::parse_and_run(app, argc, argv, "simulate",
                                 [&](std::stop_token stop) { return run(o, stop); },
                                 raystage::OnSignal::kAbort, {{"--turn-deg", "--rotation-deg"}});
}
