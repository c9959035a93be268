// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstddef>
#include <list>
#include <map>
#include <mutex>

namespace raystage::store {

/// Numbers frames between two frames of a camera, so that everything that names a frame of an
/// archive by its index can name these, too. FrameCache computes their pictures. Thread-safe.
class InterpolatedFrames {
 public:
  struct Sources {
    int first = 0, second = 0;  ///< frames of the camera's archive
    double part = 0;            ///< of the time from the first one to the second one, [0, 1]
    double line_part = 0;       ///< the camera's line time in the same unit; 0: global shutter
    auto operator<=>(const Sources&) const = default;
  };

  /// Numbers from here on are interpolated frames; smaller ones are indices in archives.
  static constexpr int kFirst = 1 << 30;
  static bool is_interpolated(int frame) { return frame >= kFirst; }

  /// Returns the number of a frame, the same for the same sources unless kMaxFrames others were
  /// asked for meanwhile.
  int number_of(const Sources& sources);
  /// Returns the sources of a number that number_of() returned.
  Sources sources_of(int frame) const;

  /// The numbers that are remembered at once: more than all frames in flight use.
  static constexpr std::size_t kMaxFrames = 1 << 16;

 private:
  struct Known {
    int number = 0;
    std::list<Sources>::iterator position;  // in by_use_
  };

  mutable std::mutex mutex_;
  int next_ = kFirst;
  std::map<Sources, Known> known_;
  std::map<int, Sources> by_number_;
  std::list<Sources> by_use_;  // most recent first
};

}  // namespace raystage::store
