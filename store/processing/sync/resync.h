// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "store/archive.h"
#include "store/processing/sync/clock_fit.h"
#include "store/timeline.h"

namespace raystage::store {

/// Time stamps and journal records of a camera's frames before resynchronisation.
struct CameraTimestamps {
  std::string id, node;              ///< node: whose clock stamped the frames; may be empty
  std::vector<Nanoseconds> stamps;   ///< of the stored frames, increasing
  std::vector<FrameRecord> missing;  ///< the journal's records of frames that are not there
  /// Times at which its recorder restarted after a stop or kill. The frame phases before and after
  /// are unrelated.
  std::vector<Nanoseconds> restarts = {};
};
/// Returns the stamps of each camera of a take. Throws Error (bad input) if the archives or the
/// reports in TAKE/recording cannot be read.
std::vector<CameraTimestamps> camera_timestamps(const Take& take);

struct ResyncOptions {
  double fps = 0;             ///< ticks per second, Hz; 0: the array's own rate
  Nanoseconds tolerance = 0;  ///< largest distance of a frame from its tick, ns; 0: half a tick
  /// True: stamps are exposure times. False: they contain transfer delays, and the fitted clock of
  /// the camera replaces them.
  bool trust_timestamps = false;
  std::optional<Nanoseconds> tick_at = {};  ///< time of one tick; none: the best phase is chosen
  bool keep_start_up = false;               ///< whether ticks also cover the start-up
  std::vector<Nanoseconds> offsets = {};    ///< of each camera's clock, subtracted; empty: none
  double nominal_fps = 0;                   ///< Hz, for takes with too few frames to measure it
  bool is_valid(std::string* reason) const;
};

/// A run of consecutive missing frames, as the fitted clock of the camera shows.
struct LostRun {
  std::int64_t first = 0, count = 0;  ///< period indices; the camera's first frame is 0
  Nanoseconds time = 0;               ///< of the first, corrected
  std::int64_t recorded = 0;          ///< how many of them the journal records as missing
  bool start_up = false;
};

/// A frame whose stamp is far from the fitted clock of its camera.
struct Outlier {
  std::int32_t frame = 0;
  Nanoseconds stamp = 0, deviation = 0;  ///< deviation: stamp minus expected time
  bool extra = false;                    ///< no free slot is left for it
};

struct CameraSync {
  std::string id, node;
  std::int64_t frames = 0;
  bool regular = false;         ///< has one rate; otherwise its stamps are used unchanged
  double period_sigma_ppm = 0;  ///< standard error of the period
  std::vector<LostRun> lost;
  std::vector<Outlier> outliers;
  std::vector<ClockStep> phase_steps;  ///< of its exposures; its clock has no step there
  std::optional<Nanoseconds> late_start, early_end;  ///< against the array, corrected

  std::int64_t lost_at_start_up() const;
  std::int64_t dropped() const;          ///< lost, but not at start-up
  std::int64_t lost_unrecorded() const;  ///< dropped, without a record in the journal
};

/// A step of the clock of a node, shared by its cameras and subtracted from their stamps.
struct NodeClockStep {
  std::string node;
  Nanoseconds time = 0, step = 0;  ///< time: corrected; step: positive: ahead
  int cameras = 0;
};

/// A time without recording on a node: its recorder was stopped or killed, and resumed.
struct RecordingPause {
  std::string node;
  Nanoseconds begin = 0, end = 0;  ///< its last frame before, its first after; corrected
};

struct ResyncResult {
  Timeline timeline;  ///< its clocks are per camera, as `cameras`
  std::vector<CameraSync> cameras;
  std::vector<NodeClockStep> steps;
  std::vector<RecordingPause> pauses;
  std::optional<Nanoseconds> start_up_end;  ///< where frames were lost more often before it
  ClockFitMethod method = ClockFitMethod::kLeastSquares;
  double least_squares_ppm = 0, envelope_ppm = 0;  ///< see ClockFits
  /// Corrected time of every frame, from which ticks were chosen; kExcludedTime: not used.
  std::vector<std::vector<Nanoseconds>> times;
};

/// Resynchronises a take as docs/resync.md describes. `name`: the take in errors. Throws Error
/// (bad input) if settings are out of range, there is no frame, or there are too many ticks.
ResyncResult resynchronise(const std::vector<CameraTimestamps>& cameras,
                           const ResyncOptions& options, std::string_view name);

/// Returns whether the take declares its stamps as arrival times, which are late by the transfer
/// delay. Stamps that mark exposures, or are not declared, are used unchanged.
bool has_arrival_timestamps(const schemas::TakeDocument& take);

}  // namespace raystage::store
