// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "store/take.h"

namespace raystage::store {

/// The frames of one instant: per camera an index into ArchiveReader::frames(), or -1 if absent.
struct FrameSelection {
  Nanoseconds time_ns = 0;
  std::vector<std::int32_t> frame;      ///< one per camera of the take
  std::vector<Nanoseconds> difference;  ///< frame time - time_ns; 0 if absent
  /// A later frame of a camera, between which and `frame` its picture is interpolated.
  struct Second {
    std::int32_t frame = -1;  ///< -1: none, the picture is that of `frame`
    double part = 0;          ///< of the time from `frame` to this one, [0, 1]
    /// The camera's line time in the same unit (rig/row_times.h); 0: global shutter, and `part` is
    /// in (0, 1).
    double line_part = 0;
    bool operator==(const Second&) const = default;
  };
  /// One per camera, as frames_at_time() selects; empty: no picture is interpolated.
  std::vector<Second> second = {};
  bool is_interpolated(std::size_t camera) const {
    return camera < second.size() && second[camera].frame >= 0;
  }
  /// Returns the latest minus the earliest frame time of the cameras present.
  Nanoseconds spread() const;
  int present() const;  ///< cameras with a frame
};

/// Returns the frame of each camera that is nearest to `time` within `tolerance`, else absent.
FrameSelection select_frames(const Take& take, Nanoseconds time, Nanoseconds tolerance);

/// Returns the default tolerance of select_frames(): half a period at `nominal_fps`, or unlimited
/// if the rate is unknown (0).
Nanoseconds default_frame_tolerance(double nominal_fps);

/// Returns the index of the tick nearest to `time` (the earlier at a tie) if it is within half a
/// tick. A timeline of one tick matches any time. `ticks`: of a timeline, at a constant rate.
std::optional<std::size_t> nearest_tick(std::span<const FrameSelection> ticks, Nanoseconds time);

/// Returns the ticks before and after the nearest tick of frames, or, if some of these are
/// interpolated, of their time. None further than half a tick outside of the timeline.
std::vector<std::size_t> adjacent_ticks(std::span<const FrameSelection> ticks,
                                        const FrameSelection& frames);

/// A sudden change of the clock that stamps a camera's frames.
struct ClockStep {
  Nanoseconds time_ns = 0;  ///< time stamp of the camera's first frame after the step
  Nanoseconds step_ns = 0;  ///< change of the clock; negative: it went back
  bool operator==(const ClockStep&) const = default;
};

/// The steps of a clock, by increasing time.
class ClockSteps {
 public:
  ClockSteps() = default;
  ClockSteps(std::initializer_list<ClockStep> steps) {
    for (const ClockStep& step : steps) add(step);
  }

  /// Adds a step. Its size is added to that of a step at the same time. Cost: the later steps.
  void add(const ClockStep& step);
  /// Returns the sum of the steps at or before a time stamp. Cost: O(log steps).
  Nanoseconds sum_until(Nanoseconds stamp) const;

  bool empty() const { return steps_.empty(); }
  std::size_t size() const { return steps_.size(); }
  const ClockStep& back() const { return steps_.back(); }
  auto begin() const { return steps_.begin(); }
  auto end() const { return steps_.end(); }
  bool operator==(const ClockSteps&) const = default;

 private:
  std::vector<ClockStep> steps_;
  std::vector<Nanoseconds> sums_;  // of the steps up to each, inclusive
};

/// The clock of one camera: the correction of its time stamps, and its free-running period and
/// phase.
struct CameraClock {
  Nanoseconds offset_ns = 0;  ///< time stamps minus the array's time
  ClockSteps steps;
  double period_ns = 0;  ///< from frame to frame; 0 without a constant rate
  double phase_ns = 0;   ///< corrected time of one frame in the middle of the camera's frames
  double drift_ppm = 0;  ///< period / tick period (or a multiple) - 1, 1e-6
  double jitter_ns = 0;  ///< robust sigma of time stamps about the fitted times
  /// Whether differences to ticks are computed from the fitted times (period and phase) instead of
  /// the corrected time stamps.
  bool fitted = false;

  /// Returns a time stamp in the array's time: without the offset and the steps before it.
  Nanoseconds corrected(Nanoseconds stamp) const;
  bool operator==(const CameraClock&) const = default;
};

/// The resynchronised table of a take: ticks at a constant rate.
struct Timeline {
  double fps = 0;
  Nanoseconds tolerance = 0;
  std::vector<FrameSelection> ticks;
  std::vector<CameraClock> clocks;  ///< one per camera; empty: time stamps are used as they are
};

/// Returns the most ticks of a timeline that this machine makes and reads: 10 million (92 hours at
/// 30 frames per second), or fewer if these would take more than half of its memory.
std::uint64_t most_ticks(std::size_t cameras);

/// Marks a frame whose time is not reliable and which must not be used.
inline constexpr Nanoseconds kExcludedTime = std::numeric_limits<Nanoseconds>::min();

/// The range from the first to the last instant at which half of the cameras with frames are
/// running.
struct TimeRange {
  Nanoseconds begin = 0, end = 0;
};
TimeRange running_range(const std::vector<std::vector<Nanoseconds>>& frame_times);

/// Returns ticks at `fps` (above 0) over `range` with their frames. The phase is `tick_at` if
/// given, otherwise the one that fits the frames best. A frame belongs to its nearest tick if it is
/// within `tolerance` (above 0). Of two frames at one tick the nearer is used, the earlier at a
/// tie. Frames at kExcludedTime are ignored.
Timeline assign_ticks(const std::vector<std::vector<Nanoseconds>>& frame_times, double fps,
                      Nanoseconds tolerance, const TimeRange& range, std::string_view name,
                      std::optional<Nanoseconds> tick_at = {});

/// Throws Error (bad input) if the rate is neither 0 nor in (0, 1e6], or the tolerance is negative.
void check_timeline_settings(double fps, Nanoseconds tolerance, std::string_view name);

/// Returns the timeline of a take over running_range() from its time stamps as they are, for takes
/// that were simulated or stamped exactly. For recordings see store/processing/sync/resync.h. `fps`
/// 0: the median of all frame intervals, or the nominal rate if there are too few. Tolerance 0:
/// half a frame time. Each frame is used for one tick only, the nearest.
Timeline build_timeline(const Take& take, double fps, Nanoseconds tolerance);

/// Builds a timeline in the same way from the frame times of the cameras; `name` is the take for
/// errors.
Timeline build_timeline(const std::vector<std::vector<Nanoseconds>>& frame_times,
                        double nominal_fps, double fps, Nanoseconds tolerance,
                        std::string_view name);

/// How well a take is synchronised.
struct TimelineStatistics {
  double mean_spread_ns = 0;  ///< over the ticks, of FrameSelection::spread()
  Nanoseconds median_spread = 0, max_spread = 0;
  std::vector<int> absent;  ///< ticks without a frame, per camera
};
TimelineStatistics timeline_statistics(const Timeline& timeline);

/// Writes TAKE/timeline.zst atomically (layout in docs/formats/timeline.md). Reproducible: the same
/// take gives the same bytes.
void write_timeline(const Timeline& timeline, const std::filesystem::path& take_folder);
/// Writes the same into the folder of an open take.
void write_timeline(const Timeline& timeline, const Take& take);
/// Reads the timeline of a take; without one, makes that of takes which need no resynchronisation
/// (store/unsynced_timeline.h). Throws Error (bad input) if it is missing otherwise (run `raystage
/// sync`), damaged, of a future version, or of another take.
Timeline read_timeline(const Take& take);
/// Reads the same, but returns nullopt if it is missing and the take needs resynchronisation.
std::optional<Timeline> read_timeline_if_present(const Take& take);

}  // namespace raystage::store
