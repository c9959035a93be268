// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "store/rotten_frame.h"
#include "store/timeline.h"

namespace raystage::store {

/// The method that computes a frame at a time between two frames. Values are not part of any
/// format.
enum class RetimeMethod {
  kNearest,  ///< the nearer frame, unchanged
  kBlend,    ///< the mean weighted by time; moving objects appear twice
  kFlow      ///< interpolation along optical flow
};

struct RetimeOptions {
  RetimeMethod method = RetimeMethod::kFlow;
  /// Largest time between two frames for interpolation, ns. 0: 2.5 ticks, which bridges one lost
  /// frame, but not two.
  Nanoseconds max_gap = 0;
  int quality = 95;  ///< JPEG quality of interpolated frames, 1-100
  RottenFrames rotten_frames = RottenFrames::kAbsent;
  bool is_valid(std::string* reason) const;
};

/// The frame of one camera at one tick of the retimed take.
struct RetimedFrame {
  enum class Kind {
    kMissing,
    kUnchanged,  ///< frame `first`, byte for byte, at its own time
    /// at time fraction `part` from frame `first` to `second`: at the tick, or with a rolling
    /// shutter also one of the two, with all of its rows at the time of the middle one
    kInterpolated
  };
  Kind kind = Kind::kMissing;
  std::int32_t first = -1, second = -1;
  double part = 0;
  double line_part = 0;  ///< the line time in the same unit; 0: global shutter
  Nanoseconds time = 0;
};

/// A frame within this fraction of a tick's period from its tick is kept unchanged.
inline constexpr double kTickToleranceFraction = 0.005;

/// Plans the ticks of one camera. If interpolation is impossible (no frame on the tick's other
/// side, or too far away), a frame that the timeline uses stays unchanged and keeps its own time.
/// With optical flow and a rolling shutter no frame stays unchanged that has another one within the
/// largest gap: its rows are moved to one time.
class RetimePlanner {
 public:
  /// `timeline` and `options` must outlive this object. `times`: corrected times of the camera's
  /// frames in ns, as in ResyncResult::times; kExcludedTime: not used. `line_time_us`: of the
  /// camera, as in rig.json.
  RetimePlanner(const Timeline& timeline, std::size_t camera, const std::vector<Nanoseconds>& times,
                const RetimeOptions& options, double line_time_us);

  /// Returns the frame at a tick of the timeline.
  RetimedFrame plan(std::size_t tick) const;
  /// Plans without this frame from now on.
  void exclude(std::int32_t frame);
  bool is_excluded(std::int32_t frame) const { return excluded_.contains(frame); }

 private:
  struct Usable {
    std::int32_t frame;
    Nanoseconds time;
  };
  /// Returns the nearest other frame of the camera; null: there is none.
  const Usable* nearest_other(const Usable& frame) const;
  RetimedFrame between(const Usable& a, const Usable& b, Nanoseconds time) const;

  const Timeline& timeline_;
  std::size_t camera_;
  const RetimeOptions& options_;
  double line_time_us_;
  std::vector<Usable> usable_;  ///< in order of time
  std::set<std::int32_t> excluded_;
};

/// Returns the frame of camera `camera` at every tick of `timeline`, see RetimePlanner.
std::vector<RetimedFrame> plan_retiming(const Timeline& timeline, std::size_t camera,
                                        const std::vector<Nanoseconds>& times,
                                        const RetimeOptions& options, double line_time_us = 0);

}  // namespace raystage::store
