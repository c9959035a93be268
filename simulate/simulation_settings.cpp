// SPDX-License-Identifier: Apache-2.0
#include "simulate/simulation_settings.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "schemas/photometric_response.h"

namespace raystage::simulate {
namespace {

template <typename Number>
void check_range(const char* name, Number value, Number low, Number high) {
  // In this form, the condition also rejects NaN.
  if (value >= low && value <= high) return;
  throw Error::bad_input(fmt::format("{} is {}, allowed: {} to {}", name, value, low, high),
                         "settings", "Give a value within that range");
}

void check_square(const char* name, int value) {
  check_range(name, value, 1, 256);
  const int side = static_cast<int>(std::lround(std::sqrt(value)));
  if (side * side != value) {
    throw Error::bad_input(fmt::format("{} is {}, which is not a square number", name, value),
                           "settings", "Give 1, 4, 9, 16, ...");
  }
}

}  // namespace

void check_simulation_settings(const SimulationSettings& s) {
  check_range("rows", s.rows, 1, 100);
  check_range("columns", s.columns, 1, 100);
  for (const double value : s.position) check_range("position (m)", value, -1e6, 1e6);
  check_range("turn (degrees)", s.turn_deg, -360.0, 360.0);
  check_range("spacing (m)", s.spacing, 0.0, 10.0);
  check_range("horizontal field of view (degrees)", s.horizontal_fov_deg, 1.0, 150.0);
  check_range("width", s.width, 1, 16384);
  check_range("height", s.height, 1, 16384);
  check_range("k1", s.k1, -10.0, 10.0);
  check_range("k2", s.k2, -10.0, 10.0);
  check_range("lens deviation", s.lens_deviation, 0.0, 10.0);
  check_range("mounting error (m)", s.mounting_error, 0.0, 1.0);
  check_range("mounting error (degrees)", s.mounting_error_deg, 0.0, 45.0);
  check_range("photometric deviation", s.photometric_deviation, 0.0, 0.2);
  check_range("gain", s.color_errors.gain, 0.0, 0.9);
  check_range("white balance", s.color_errors.white_balance, 0.0, 0.9);
  check_range("offset", s.color_errors.offset, 0.0, 0.5);
  check_range("vignetting", s.color_errors.vignetting, 0.0, 0.9);
  check_range("mix of colours", s.color_errors.crosstalk, 0.0, 0.3);
  check_range("curve", s.color_errors.curve, 0.0, 0.5);
  check_range("hot pixels", s.color_errors.hot_pixels, 0,
              static_cast<int>(schemas::PhotometricResponse::kMaxHotPixels));
  check_range("fps", s.fps, 0.1, 1000.0);
  check_range("seconds", s.seconds, 0.0, 36000.0);
  check_range("frames per camera", s.seconds * s.fps + 1e-9, 1.0, 1e6);
  check_range("period error (ppm)", s.period_error_ppm, 0.0, 1000.0);
  check_range("jitter (s)", s.jitter, 0.0, 0.05 / s.fps);
  check_range("clock offset (s)", s.clock_offset, 0.0, 10.0);
  check_range("cameras per node", s.cameras_per_node, 1, 10000);
  check_range("start-up loss (s)", s.startup_loss_s, 0.0, s.seconds);
  check_range("drop probability", s.drop_probability, 0.0, 0.99);
  check_range("noise", s.noise, 0.0, 1.0);
  check_square("samples at edges", s.edge_samples);
  check_square("samples of the truth", s.truth_samples);
  check_range("truth views", s.truth_views, 0, 10000);
  check_range("truth width", s.truth_width, 0, 16384);
  check_range("truth height", s.truth_height, 0, 16384);
  check_range("shot frames", s.shot_frames, 1, 1'000'000);
}

}  // namespace raystage::simulate
