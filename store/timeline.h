// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "store/take.h"

namespace raystage {

/// The frames of one instant: per camera an index into ArchiveReader::frames(), or -1 for absent.
struct FrameSelection {
  Nanoseconds time_ns = 0;
  std::vector<std::int32_t> frame;      ///< one per camera of the take
  std::vector<Nanoseconds> difference;  ///< frame time - time_ns; 0 where absent
  /// Latest minus earliest frame time of the cameras present.
  Nanoseconds spread() const;
  int present() const;
};

/// Nearest frame of each camera within `tolerance` of `time`, else absent.
FrameSelection select_frames(const Take& take, Nanoseconds time, Nanoseconds tolerance);

/// How far a frame of a take at `nominal_fps` may be stamped from an instant to be of it, as
/// select_frames() takes it: half a period; as far as may be where the rate is not known (0).
Nanoseconds tolerance_of_stamps(double nominal_fps);

/// The tick that shows `time`: the nearest, the earlier at a tie, if it lies within half a tick;
/// that of a still whenever it is. `ticks`: a timeline's, at a constant rate.
std::optional<std::size_t> nearest_tick(std::span<const FrameSelection> ticks, Nanoseconds time);

/// A sudden change of the clock that stamped a camera's frames.
struct ClockStep {
  Nanoseconds time_ns = 0;  ///< stamp of the camera's first frame after it
  Nanoseconds step_ns = 0;  ///< how far the clock jumped ahead; negative: back
  bool operator==(const ClockStep&) const = default;
};

/// What is known of the clock of one camera: how its stamps are corrected, and the period and phase
/// at which it runs free.
struct CameraClock {
  Nanoseconds offset_ns = 0;     ///< how far the stamps are ahead of the array's time
  std::vector<ClockStep> steps;  ///< by increasing time
  double period_ns = 0;          ///< from frame to frame; 0 where no constant rate was found
  double phase_ns = 0;   ///< corrected time of one frame in the middle of the camera's frames
  double drift_ppm = 0;  ///< its period over the ticks' (or their multiple) - 1, millionths
  double jitter_ns = 0;  ///< robust sigma of the stamps about period and phase
  /// Differences to ticks count from the times of period and phase; false: from corrected stamps.
  bool fitted = false;

  /// A stamp on the array's time: offset and the steps before it taken off.
  Nanoseconds corrected(Nanoseconds stamp) const;
  bool operator==(const CameraClock&) const = default;
};

/// The resynchronised table of a take: ticks at a constant rate.
struct Timeline {
  double fps = 0;
  Nanoseconds tolerance = 0;
  std::vector<FrameSelection> ticks;
  std::vector<CameraClock> clocks;  ///< one per camera; empty: stamps are taken as they are
};

/// The time of a frame that shall not be used: its own is not to be trusted.
inline constexpr Nanoseconds kNoTime = std::numeric_limits<Nanoseconds>::min();

/// From the first instant by which half of the cameras (that have frames) run to the last such.
struct TimeRange {
  Nanoseconds begin = 0, end = 0;
};
TimeRange running_range(const std::vector<std::vector<Nanoseconds>>& frame_times);

/// Ticks at `fps` (above 0) over `range`, at the phase that fits the frames best or with a tick at
/// `tick_at`, and the frames they take. A frame belongs to the tick it is nearest to, if within
/// `tolerance` (above 0); of two at one tick the nearer one is taken, the earlier at a tie. Frames
/// at kNoTime are left out.
Timeline assign_ticks(const std::vector<std::vector<Nanoseconds>>& frame_times, double fps,
                      Nanoseconds tolerance, const TimeRange& range, std::string_view name,
                      std::optional<Nanoseconds> tick_at = {});

/// Throws Error (bad input) for a rate that is neither 0 nor in (0, 1e6] or a negative tolerance.
void check_settings(double fps, Nanoseconds tolerance, std::string_view name);

/// Ticks at `fps` (0: detected as the median over all frame intervals; nominal rate where there are
/// too few), from the first instant by which half of the cameras run to the last such. Tolerance 0
/// means half a frame time. A frame is used for one tick only: the nearest.
/// Times are taken as they are: takes that were simulated or stamped exactly. What recordings need
/// is in store/processing/sync/resync.h.
Timeline build_timeline(const Take& take, double fps, Nanoseconds tolerance);

/// The same from the cameras' frame times alone; `name` stands for the take in errors.
Timeline build_timeline(const std::vector<std::vector<Nanoseconds>>& frame_times,
                        double nominal_fps, double fps, Nanoseconds tolerance,
                        std::string_view name);

/// What a timeline says about a take's synchrony.
struct TimelineStatistics {
  double mean_spread_ns = 0;  ///< over the ticks, of FrameSelection::spread()
  Nanoseconds median_spread = 0, max_spread = 0;
  std::vector<int> absent;  ///< ticks without a frame, per camera
};
TimelineStatistics statistics_of(const Timeline& timeline);

/// TAKE/timeline.zst; layout in docs/formats/timeline.md. Atomic. Reproducible: same take, same
/// bytes.
void write_timeline(const Timeline& timeline, const std::filesystem::path& take_folder);
/// The same into the folder of a take that is open.
void write_timeline(const Timeline& timeline, const Take& take);
/// Throws Error (bad input): missing (run `raystage sync`), damaged, of a future version, or not of
/// this take.
Timeline read_timeline(const Take& take);
/// The same, but nothing where it is missing.
std::optional<Timeline> read_timeline_if_any(const Take& take);

}  // namespace raystage
