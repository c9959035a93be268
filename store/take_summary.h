// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "store/take.h"
#include "store/timeline.h"

namespace raystage {

/// What a take holds and what it lacks, for `raystage info`.
struct TakeSummary {
  struct Camera {
    std::string id;
    int width = 0, height = 0;  ///< pixels
    int frames = 0;             ///< stored
    std::array<int, kFrameStatusCount> by_status{};
    int recovered = 0, damaged_records = 0;  ///< see ArchiveReader
    bool closed = false;
    std::uint64_t bytes = 0;  ///< of the archive
    /// Whether the first frame carries restart markers; nothing where there is no frame or it is no
    /// JPEG.
    std::optional<bool> restart_markers;
    std::string error;  ///< why the archive cannot be read; empty when it can
  };
  std::vector<Camera> cameras;

  std::uint64_t bytes_on_disk = 0;  ///< of everything below the take's folder
  std::uint64_t bytes_of_archives = 0;
  double fps = 0;                       ///< detected, else nominal; 0 where unknown
  Nanoseconds first = 0, duration = 0;  ///< from the earliest frame to the end of the latest
  /// When its recorders started anew after they were stopped or killed, each once; ns.
  std::vector<Nanoseconds> restarts;
  /// Nodes that began later than they were told to, and by how much.
  std::vector<std::pair<std::string, Nanoseconds>> late_nodes;
  std::string restarts_error;  ///< why neither is known; empty when it is
  bool calibrated = true;      ///< false: spacing and lenses are guessed
  /// Median distance of a camera to its nearest neighbour, metres; 0 for one camera.
  double spacing = 0;
  /// Eq. 4.3: nothing nearer than this is free of aliasing, metres; 0 where it has no meaning.
  double alias_free_distance = 0;

  /// Of the timeline, where there is a valid one.
  struct TimelineSummary {
    double fps = 0;
    int ticks = 0;
    TimelineStatistics statistics;
  };
  std::optional<TimelineSummary> timeline;
  std::string timeline_error;  ///< why there is none

  std::uint64_t frames() const;
  bool whole() const;  ///< every archive can be read
};

/// Opens every archive; one that cannot be read is reported in its camera's `error`.
TakeSummary summarise(const Take& take);

/// Eq. 4.3: zmin = spacing * f / (2 dv), with f / dv the focal length in pixels.
double alias_free_distance(double spacing_m, double focal_length_px);

}  // namespace raystage
