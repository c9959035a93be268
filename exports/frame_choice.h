// SPDX-License-Identifier: Apache-2.0
// Which frames of a take are exported, and at which times.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::exports {

/// The times of exported frames.
enum class FrameTimes {
  kRecorded,      ///< every recorded frame at its own time stamp
  kSynchronised,  ///< the same in the array's time: time stamps corrected by the timeline's clocks
  kConstant       ///< one frame per tick of the timeline, or per 1 / fps
};

/// What stands at a tick for a camera without a frame, as OpenTimelineIO's MissingFramePolicy.
enum class AbsentFrames {
  kError,  ///< the export fails before anything is written
  kHold,   ///< the camera's previous frame, or else its next one
  kBlack,  ///< a black picture
  kGap     ///< nothing
};

struct FrameChoiceOptions {
  std::vector<std::string> cameras = {};  ///< ids, in the order of the output; empty: all
  /// Frames, sorted; frame n is tick n - 1 of the timeline. None: all. With kRecorded and
  /// kSynchronised: frames whose nearest tick is one of these.
  std::optional<std::vector<int>> frames = {};
  std::optional<double> from_s = {}, to_s = {};  ///< seconds since the take's epoch, inclusive
  FrameTimes times = FrameTimes::kRecorded;
  AbsentFrames absent = AbsentFrames::kHold;  ///< of kConstant
  /// Frames per second of kConstant; 0: one frame per tick, at the take's nominal rate if the
  /// timeline's is within 0.1 % of it, otherwise at the timeline's.
  double fps = 0;
  /// Whether time 0 of the output is the first exported frame of all cameras instead of the take's
  /// epoch. That of kConstant always is.
  bool starts_at_zero = false;
  bool is_valid(std::string* reason) const;
};

/// A frame of the output.
struct ChosenFrame {
  int number = 0;             ///< frame number: tick + 1, or that of the output with another fps
  int source = -1;            ///< index into ArchiveReader::frames(); -1: a black picture
  Nanoseconds time_ns = 0;    ///< in the output
  Nanoseconds source_ns = 0;  ///< time stamp of the source frame since the take's epoch
  bool is_held = false;       ///< an absent frame, for which this one stands
};

struct CameraFrames {
  int camera = 0;
  std::vector<ChosenFrame> frames;
  int absent =
      0;  ///< kConstant: ticks without a frame; else records of missing frames in the range
};

struct FrameChoice {
  std::vector<CameraFrames> cameras;
  double fps = 0;                ///< of the timeline, or of kConstant
  Nanoseconds origin_ns = 0;     ///< time since the take's epoch that is time 0 of the output
  std::size_t frames() const;    ///< of all cameras
  std::size_t source_bytes = 0;  ///< JPEG bytes of the frames
};

/// Returns the frames to export. Reads timeline.zst only if it is needed. Throws Error (bad input)
/// for an unknown camera, a take without timeline where one is needed, if no frame is left, and for
/// absent frames with kError.
FrameChoice choose_frames(const store::Take& take, const FrameChoiceOptions& options);

}  // namespace raystage::exports
