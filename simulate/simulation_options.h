// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "schemas/rig_document.h"
#include "store/jpeg/encode.h"

namespace raystage::simulate {

/// Limits of the random colour errors of each camera.
struct ColorErrors {
  double gain = 0;           ///< factor of a camera: 1 +- at most this
  double white_balance = 0;  ///< factor of red and blue relative to green: 1 +- at most this
  double offset = 0;         ///< of a channel, full scale 1: at most this
  double vignetting = 0;     ///< largest share of light lost in a corner
  double crosstalk = 0;      ///< largest share of each other channel in a channel
  double curve = 0;          ///< exponent applied to the codes: 1 +- at most this
  int hot_pixels = 0;        ///< per camera
};

/// Settings of a simulation. The defaults are the thesis' array (chapter 4), free-running.
struct SimulationOptions {
  std::string scene = "stage";
  std::uint64_t seed = 1;

  // The array as designed: parallel cameras in a plane around `position`; they look along -z if
  // `turn_deg` is 0.
  std::array<double, 3> position{0, 0, 0};  ///< of its centre, world, metres
  double turn_deg = 0;                      ///< about the y axis, counter-clockwise seen from above
  int rows = 8, columns = 8;
  double spacing = 0.06;           ///< between neighbours, metres
  double horizontal_fov_deg = 62;  ///< without distortion, full angle
  int width = 320, height = 240;   ///< pixels
  schemas::Projection lens = schemas::Projection::kPinhole;
  /// radial distortion: Brown-Conrady of a pinhole, of r^3 and r^5 of other projections
  double k1 = -0.2, k2 = 0.05;
  /// Cameras to use instead of a grid: their poses, relative to the array's, and their lenses, with
  /// pictures of `width` pixels. No calibration of colours.
  std::optional<schemas::RigDocument> given_rig = std::nullopt;

  // How the cameras differ from the design and from each other.
  /// scale of the standard deviations; 1: focal length 0.3 %, principal point 0.6 % of the width,
  /// k1 and k2 0.01
  double lens_deviation = 1;
  double mounting_error = 0.003;    ///< largest distance from the design, metres
  double mounting_error_deg = 0.6;  ///< largest rotation about any axis
  /// standard deviation of the contrast per channel; that of the brightness is a twentieth
  double photometric_deviation = 0;
  ColorErrors color_errors;          ///< in addition
  bool nominal_calibration = false;  ///< rig.json contains the design, not the truth

  // Time.
  double fps = 15;
  double seconds = 3.8;
  double period_error_ppm = 50;  ///< standard deviation of a camera's frame period
  double jitter = 0.0002;        ///< standard deviation of exposure times, seconds
  double clock_offset = 0.005;   ///< largest error of a node's clock, seconds
  int cameras_per_node = 16;
  double startup_loss_s = 0.5;     ///< frames before this time are lost
  double drop_probability = 0.01;  ///< of a later frame
  /// From the exposure of a row to that of the row below, microseconds, as in rig.json; the
  /// read-out of a frame takes at most one frame time. nullopt: those of the given rig, whose
  /// read-outs take as long in the scaled pictures; 0 of a grid.
  std::optional<double> line_time_us = std::nullopt;

  // Pictures.
  /// Lamps are kHighlights times as bright, so that the stage spans about 14 stops. Targets, whose
  /// exposure matters, are as they are.
  bool hdr = false;
  static constexpr float kHighlights = 64;
  /// Frames of the linear light in half floats, as JPEG XL pictures; false: JPEG, clipped at white.
  bool records_half = false;
  double noise = 0.005;  ///< standard deviation at full scale; scales with sqrt(light)
  int edge_samples = 4;  ///< per pixel at edges: a square number
  store::JpegEncodeOptions jpeg;

  // Truth.
  int truth_views = 8;
  int truth_width = 0, truth_height = 0;  ///< pixels; 0: as the cameras
  int truth_samples = 16;                 ///< per pixel: a square number
  /// Unlit balls in the views only: x, y, z of the centre and radius, world, metres.
  std::vector<std::array<double, 4>> truth_spheres;
  /// Write the true depths of the cameras' frames: truth/depths/CAMERA/000001.exr.
  bool camera_depths = false;
  double truth_shutter_deg = 0;  ///< of the views; the cameras' exposures are instants
  int shot_frames = 48;

  bool is_valid(std::string* reason) const;

  int camera_count() const {
    return given_rig ? static_cast<int>(given_rig->cameras.size()) : rows * columns;
  }
  int frames_per_camera() const { return static_cast<int>(seconds * fps + 1e-9); }
  int view_width() const { return truth_width > 0 ? truth_width : width; }
  int view_height() const { return truth_height > 0 ? truth_height : height; }
};

}  // namespace raystage::simulate
