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

namespace raystage {

/// What is known of a camera's frames before resynchronisation.
struct CameraStamps {
  std::string id, node;              ///< node: whose clock stamped the frames; may be empty
  std::vector<Nanoseconds> stamps;   ///< of the stored frames, increasing
  std::vector<FrameRecord> missing;  ///< the journal's records of frames that are not there
  /// When its recorder started anew after it was stopped or killed: stamps before and after are of
  /// rhythms that have nothing to do with each other.
  std::vector<Nanoseconds> restarts = {};
};
/// Throws Error (bad input) where archives or the accounts in TAKE/recording cannot be read.
std::vector<CameraStamps> stamps_of(const Take& take);

struct ResyncSettings {
  double fps = 0;             ///< ticks a second, Hz; 0: the array's own rate
  Nanoseconds tolerance = 0;  ///< how far a frame may lie from its tick; 0: half a tick
  /// Whether stamps say when a frame was exposed (true), or were delayed on their way and the
  /// camera's rhythm knows better.
  bool exact_stamps = false;
  std::optional<Nanoseconds> tick_at = {};  ///< a tick falls here; none: where the frames lie best
  bool keep_start_up = false;               ///< ticks begin before the start-up is over, too
  std::vector<Nanoseconds> offsets = {};    ///< of each camera's clock, taken off; empty: none
  double nominal_fps = 0;                   ///< for takes with too few frames to tell
};

/// Frames that a camera's rhythm says there were, one after the other, and that are not there.
struct LostRun {
  std::int64_t first = 0, count = 0;  ///< period indices; the camera's first frame is 0
  Nanoseconds time = 0;               ///< of the first, corrected
  std::int64_t recorded = 0;          ///< how many of them the journal has on record as missing
  bool start_up = false;
};

/// A frame whose stamp is far from its camera's rhythm.
struct Outlier {
  std::int32_t frame = 0;
  Nanoseconds stamp = 0, by = 0;  ///< by: stamp minus where it should be
  bool extra = false;             ///< no period is left for it
};

struct CameraSync {
  std::string id, node;
  std::int64_t frames = 0;
  bool regular = false;         ///< holds one rate; otherwise its stamps are taken as they are
  double period_sigma_ppm = 0;  ///< standard error of the period
  std::vector<LostRun> lost;
  std::vector<Outlier> outliers;
  std::vector<ClockStep> jumps;  ///< of its rhythm, the clock being right: it truly exposed later
  std::optional<Nanoseconds> late_start, early_end;  ///< against the array, corrected

  std::int64_t lost_at_start_up() const;
  std::int64_t dropped() const;          ///< lost, but not at start-up
  std::int64_t lost_unrecorded() const;  ///< dropped, and the journal does not know
};

/// A step of the clock of a node, shared by its cameras and taken off their stamps.
struct NodeStep {
  std::string node;
  Nanoseconds time = 0, step = 0;  ///< time: corrected; step: positive: ahead
  int cameras = 0;
};

/// Nobody recorded on a node: its recorder was stopped or killed, and resumed.
struct Pause {
  std::string node;
  Nanoseconds begin = 0, end = 0;  ///< its last frame before, its first after; corrected
};

struct Resync {
  Timeline timeline;  ///< its clocks are per camera, as `cameras`
  std::vector<CameraSync> cameras;
  std::vector<NodeStep> steps;
  std::vector<Pause> pauses;
  std::optional<Nanoseconds> start_up_end;  ///< where frames were lost more often before it
  FitMethod method = FitMethod::kLeastSquares;
  double least_squares_ppm = 0, envelope_ppm = 0;  ///< see ClockFits
  /// Corrected time of every frame, as ticks were chosen by; kNoTime: left out.
  std::vector<std::vector<Nanoseconds>> times;
};

/// Resynchronises a take: docs/resync.md says how. `name` stands for it in errors. Throws Error
/// (bad input): settings out of range, no frame at all, too many ticks.
Resync resynchronise(const std::vector<CameraStamps>& cameras, const ResyncSettings& settings,
                     std::string_view name);

/// Whether the take says that its stamps mark arrivals: then they are late by what the way took.
/// Stamps that mark exposures, or of which nothing is known, are taken at their word.
bool marks_arrivals(const TakeDocument& take);

}  // namespace raystage
