// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "schemas/time.h"
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

/// The resynchronised table of a take: ticks at a constant rate.
struct Timeline {
  double fps = 0;
  Nanoseconds tolerance = 0;
  std::vector<FrameSelection> ticks;
};

/// Ticks at `fps` (0: detected as the median over all frame intervals; nominal rate where there are
/// too few), from the first instant by which half of the cameras run to the last such. Tolerance 0
/// means half a frame time. A frame is used for one tick only: the nearest.
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
/// Throws Error (bad input): missing (run `raystage sync`), damaged, of a future version, or not of
/// this take.
Timeline read_timeline(const Take& take);

}  // namespace raystage
