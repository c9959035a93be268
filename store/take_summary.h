// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rig/lens_summary.h"
#include "store/shutter_summary.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::store {

/// The contents of a take and what it lacks, for `raystage info`.
struct TakeSummary {
  struct Camera {
    std::string id;
    int width = 0, height = 0;  ///< pixels
    int frames = 0;             ///< in the archive
    bool is_cut = false;        ///< the archive was closed and has become shorter since
    int lost = 0;  ///< stored frames that the archive lost with its end after it had been closed
    std::array<int, kFrameStatusCount> by_status{};  ///< with the lost ones as stored
    int recovered = 0, damaged_records = 0;          ///< see ArchiveReader
    int unverified = 0;                              ///< see FrameRecord::is_unverified
    bool closed = false;
    std::uint64_t bytes = 0;  ///< of the archive
    bool packed = false;      ///< see FrameCodec
    std::string video;        ///< codec of temporal frames, empty if they are not
    int packed_frames = 0;    ///< of `frames`; the others are stored as JPEG
    /// Of pictures of more than 8 bits; nullopt: frames are JPEG.
    std::optional<schemas::PixelEncoding> pixels = {};
    /// Whether the first frame has restart markers; nullopt if there is no frame or it is not
    /// stored as JPEG.
    std::optional<bool> restart_markers;
    std::string error;  ///< why the archive cannot be read; empty if it can
  };
  std::vector<Camera> cameras;

  std::uint64_t bytes_on_disk = 0;  ///< of all files in the take's folder
  std::uint64_t archive_bytes = 0;
  double fps = 0;                       ///< detected, else nominal; 0 if unknown
  Nanoseconds first = 0, duration = 0;  ///< from the earliest frame to the end of the latest
  /// Times of all restarts of the recorders after a stop or crash, without duplicates; ns.
  std::vector<Nanoseconds> restarts;
  /// Nodes that started later than requested, and their delay in ns.
  std::vector<std::pair<std::string, Nanoseconds>> late_nodes;
  std::string restarts_error;  ///< why neither is known; empty if they are
  ShutterSummary shutters;
  bool calibrated = true;  ///< false: spacing and lenses are estimates
  /// Median distance from a camera to its nearest neighbour, metres; 0 for one camera.
  double spacing = 0;
  /// Distance from which the scene is free of aliasing (Eq. 4.3), metres; 0 if undefined.
  double min_alias_free_distance = 0;
  std::vector<rig::LensSummary> lenses;

  /// Summary of the timeline, if there is a valid one.
  struct TimelineSummary {
    double fps = 0;
    int ticks = 0;
    TimelineStatistics statistics;
  };
  std::optional<TimelineSummary> timeline;
  std::string timeline_error;  ///< why there is no timeline, and what to do

  std::uint64_t frames() const;
  bool is_readable() const;  ///< whether every archive can be read
};

/// Returns the summary of a take. Opens every archive; reports one that cannot be read in its
/// camera's `error`.
TakeSummary summarise_take(const Take& take);

/// Returns the median distance from a camera to its nearest neighbour, metres; 0 for one camera.
double median_baseline(const rig::Rig& rig);

/// Returns the alias-free distance zmin = spacing * f / (2 dv) in metres (Eq. 4.3); f / dv is the
/// focal length in pixels.
double min_alias_free_distance(double spacing_m, double focal_length_px);

}  // namespace raystage::store
