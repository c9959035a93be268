// SPDX-License-Identifier: Apache-2.0
#include "simulate/simulation_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/options.h"
#include "schemas/photometric_response.h"

namespace raystage::simulate {
namespace {

/// Returns whether the rows of every frame are exposed within a frame time.
bool rows_fit_a_frame(const SimulationOptions& s, std::string* reason) {
  const double frame_us = 1e6 / s.fps;
  if (!s.given_rig) {
    const double most = frame_us / s.height;
    return is_within("line time (us)", s.line_time_us.value_or(0), -most, most, reason);
  }
  return std::ranges::all_of(s.given_rig->cameras, [&](const auto& camera) {
    const schemas::CameraGeometry& geometry = camera.geometry;
    // Pictures are scaled to `width`; the read-out of a given line time is not.
    const double rows = static_cast<double>(geometry.height) *
                        (s.line_time_us ? static_cast<double>(s.width) / geometry.width : 1);
    const std::string name = fmt::format("line time of camera {} (us)", geometry.id);
    return is_within(name, s.line_time_us.value_or(geometry.line_time_us), -frame_us / rows,
                     frame_us / rows, reason);
  });
}

bool is_square(const char* name, int value, std::string* reason) {
  if (!is_within(name, value, 1, 256, reason)) return false;
  const int side = static_cast<int>(std::lround(std::sqrt(value)));
  if (side * side == value) return true;
  *reason = fmt::format("{} is {}, allowed: the square numbers 1, 4, 9, 16, ...", name, value);
  return false;
}

}  // namespace

bool SimulationOptions::is_valid(std::string* reason) const {
  if (records_half && color_errors.curve > 0) {
    *reason = "the response curve deviates, allowed: no deviation in frames of half floats";
    return false;
  }
  const auto within = [&](const char* name, double value, double low, double high) {
    return is_within(name, value, low, high, reason);
  };
  return within("rows", rows, 1, 100) && within("columns", columns, 1, 100) &&
         std::ranges::all_of(
             position,
             [&](double value) { return is_within("position (m)", value, -1e6, 1e6, reason); }) &&
         within("turn (degrees)", turn_deg, -360, 360) && within("spacing (m)", spacing, 0, 10) &&
         within("horizontal field of view (degrees)", horizontal_fov_deg, 1,
                lens == schemas::Projection::kPinhole        ? 150
                : lens == schemas::Projection::kOrthographic ? 180
                                                             : 300) &&
         within("width", width, 1, 16384) && within("height", height, 1, 16384) &&
         within("k1", k1, -10, 10) && within("k2", k2, -10, 10) &&
         within("lens deviation", lens_deviation, 0, 10) &&
         within("mounting error (m)", mounting_error, 0, 1) &&
         within("mounting error (degrees)", mounting_error_deg, 0, 45) &&
         within("photometric deviation", photometric_deviation, 0, 0.2) &&
         within("gain", color_errors.gain, 0, 0.9) &&
         within("white balance", color_errors.white_balance, 0, 0.9) &&
         within("offset", color_errors.offset, 0, 0.5) &&
         within("vignetting", color_errors.vignetting, 0, 0.9) &&
         within("mix of colours", color_errors.crosstalk, 0, 0.3) &&
         within("curve", color_errors.curve, 0, 0.5) &&
         within("hot pixels", color_errors.hot_pixels, 0,
                schemas::PhotometricResponse::kMaxHotPixels) &&
         within("fps", fps, 0.1, 1000) && within("seconds", seconds, 0, 36000) &&
         within("frames per camera", seconds * fps + 1e-9, 1, 1e6) &&
         within("period error (ppm)", period_error_ppm, 0, 1000) &&
         within("jitter (s)", jitter, 0, 0.05 / fps) &&
         within("clock offset (s)", clock_offset, 0, 10) &&
         within("cameras per node", cameras_per_node, 1, 10000) &&
         within("start-up loss (s)", startup_loss_s, 0, seconds) &&
         within("drop probability", drop_probability, 0, 0.99) && rows_fit_a_frame(*this, reason) &&
         within("noise", noise, 0, 1) && is_square("samples at edges", edge_samples, reason) &&
         is_square("samples of the truth", truth_samples, reason) &&
         within("truth views", truth_views, 0, 10000) &&
         within("truth width", truth_width, 0, 16384) &&
         within("truth height", truth_height, 0, 16384) &&
         std::ranges::all_of(truth_spheres,
                             [&](const auto& sphere) {
                               return is_within("radius of a sphere (m)", sphere[3], 1e-3, 1e3,
                                                reason);
                             }) &&
         within("shutter angle of the views", truth_shutter_deg, 0, 360) &&
         within("shot frames", shot_frames, 1, 1'000'000);
}

}  // namespace raystage::simulate
