// SPDX-License-Identifier: Apache-2.0
// Detections of a whole take, and the settings of a calibration that depend on its cameras.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <vector>

#include "calibrate/detect/board.h"
#include "calibrate/detect/feature_matching.h"
#include "calibrate/track_calibration.h"
#include "schemas/rig_document.h"
#include "store/take.h"

namespace raystage::calibrate {

/// Returns the tracks of a small light in a take, in synchronised time, with the line times that
/// its rig states. Errors and progress as
/// track_light().
RecordedTracks record_light_tracks(const store::Take& take, const LightDetectionOptions& options,
                                   const std::function<void(double)>& progress,
                                   const std::stop_token& stop);

/// Returns the tracks of the corners of a board in a take. Errors and progress as track_light().
RecordedTracks record_board_tracks(const store::Take& take, const BoardDetector& detector,
                                   const std::function<void(double)>& progress,
                                   const std::stop_token& stop);

/// Returns settings for tracks of a board: instants at which the board is still, corners that
/// determine the scale. `max_instants`: at most so many are used; 80 by default, each has many
/// corners.
TrackCalibrationOptions board_calibration_options(const Board& board,
                                                  std::optional<int> max_instants);

/// Returns points of the scene itself (match_features()) from the frames at `time`; by default at
/// the middle of the time in which all cameras ran.
Detections match_scene_features(const store::Take& take, std::optional<Nanoseconds> time,
                                const FeatureMatchingOptions& options,
                                const std::function<void(double)>& progress,
                                const std::stop_token& stop);

/// Returns the lens model of each camera in the rig of a take.
std::vector<LensModel> recorded_lens_models(const store::Take& take);

/// Returns initial intrinsics for each camera: those of `rig` by id, or of its only camera for all.
/// `rig_file` names it in errors. Throws Error (bad input) for a camera without a lens and for
/// another frame size.
std::vector<schemas::Intrinsics> initial_lenses(
    const schemas::RigDocument& rig, const std::filesystem::path& rig_file,
    const std::vector<schemas::DetectionsDocument::Camera>& cameras);

/// Returns the lens of each camera that the settings give (initial lenses, or the initial rig);
/// empty: none.
std::vector<schemas::Intrinsics> known_lenses(
    const CalibrationOptions& options,
    const std::vector<schemas::DetectionsDocument::Camera>& cameras);

/// Throws Error (bad input) if lenses are fixed and unknown, if the field of view is too wide for a
/// pinhole, or if a fixed camera or a camera of
/// the measured distance is not in `cameras`.
void check_calibration_options(const CalibrationOptions& options,
                               const std::vector<schemas::DetectionsDocument::Camera>& cameras);

}  // namespace raystage::calibrate
