// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "store/jpeg/encode.h"

namespace raystage {

/// How cameras show colours wrong, each in its own way.
struct ColorErrors {
  double gain = 0;           ///< of a camera: 1 +- this at most
  double white_balance = 0;  ///< of red and blue beside green: 1 +- this at most
  double offset = 0;         ///< of a channel, light with full scale 1: this at most
  double vignetting = 0;     ///< share of light lost in the corner, at most
  double crosstalk = 0;      ///< of each other channel's light in a channel, at most
  double curve = 0;          ///< codes are raised to the power of 1 +- this at most
  int hot_pixels = 0;        ///< per camera, which show light in the dark
};

/// What to simulate. The defaults are the thesis' array (chapter 4) with free-running cameras.
struct SimulationSettings {
  std::string scene = "stage";
  std::uint64_t seed = 1;

  // The array as designed: wall-eyed, in a plane around `position`, looking down -z where nothing
  // turns it.
  std::array<double, 3> position{0, 0, 0};  ///< of its middle, world, metres
  double turn_deg = 0;                      ///< about the y axis, counter-clockwise from above
  int rows = 8, columns = 8;
  double spacing = 0.06;           ///< between neighbours, metres
  double horizontal_fov_deg = 62;  ///< of the lens without its distortion, full angle
  int width = 320, height = 240;   ///< pixels
  double k1 = -0.2, k2 = 0.05;     ///< radial distortion of the lens type

  // How the cameras differ from the design and from each other.
  double lens_deviation = 1;         ///< 1: focal length 0.3 %, principal point 0.6 % of the width,
                                     ///< k1 and k2 0.01 (standard deviations); scales them all
  double mounting_error = 0.003;     ///< at most, metres from the designed place
  double mounting_error_deg = 0.6;   ///< at most, turned about any axis
  double photometric_deviation = 0;  ///< standard deviation of the contrast per channel;
                                     ///< brightness has a twentieth of it
  ColorErrors color_errors;          ///< besides
  bool nominal_calibration = false;  ///< rig.json holds the design instead of the truth

  // Time.
  double fps = 15;
  double seconds = 3.8;
  double period_error_ppm = 50;  ///< standard deviation of a camera's own rate
  double jitter = 0.0002;        ///< standard deviation of an exposure's time, seconds
  double clock_offset = 0.005;   ///< largest error of a node's clock, seconds
  int cameras_per_node = 16;
  double startup_loss_s = 0.5;     ///< frames before this are lost, seconds
  double drop_probability = 0.01;  ///< of a frame afterwards

  // Pictures.
  double noise = 0.005;  ///< standard deviation at full scale; falls with the root of the light
  int edge_samples = 4;  ///< per pixel at edges: a square number
  JpegEncodeSettings jpeg;

  // Truth.
  int truth_views = 8;
  int truth_width = 0, truth_height = 0;  ///< pixels; 0: as the cameras
  int truth_samples = 16;                 ///< per pixel: a square number
  int shot_frames = 48;

  int camera_count() const { return rows * columns; }
  int frames_per_camera() const { return static_cast<int>(seconds * fps + 1e-9); }
  int view_width() const { return truth_width > 0 ? truth_width : width; }
  int view_height() const { return truth_height > 0 ? truth_height : height; }
};

/// Throws Error (bad input) that names the setting, its value and the allowed range.
void check_simulation_settings(const SimulationSettings& settings);

}  // namespace raystage
