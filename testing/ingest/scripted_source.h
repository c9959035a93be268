// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "ingest/sources/frame_source.h"

namespace raystage {

/// What a source of frames in memory delivers, and how it misbehaves: for tests and benchmarks of
/// the recorder. Exposures are counted from 0; those that a gap swallows count too.
struct SourceScript {
  /// Delivered in turn, over and over; at least one. Only `jpeg` and `raw` are used.
  std::vector<SourceFrame> frames;
  double fps = 0;                      ///< 0: as fast as asked
  std::optional<std::uint64_t> count;  ///< exposures, then the end; without: no end
  /// Frames that wait to be asked for, as a driver's buffers do; what comes in when they are full
  /// is lost, and the counter shows it. 0: nothing is ever lost.
  int buffers = 0;
  bool stamps = true;    ///< device_time and sequence are given
  double clock_ppm = 0;  ///< error of the device's clock
  double jitter = 0;     ///< arrival is late by up to so much, seconds (hashed from the exposure)
  std::string timestamp_event = "arrival";

  /// The device delivers nothing for so long, seconds; what it exposes meanwhile, at fps, is lost.
  struct Stall {
    double seconds = 0;
  };
  /// The device is gone, once its buffers are empty.
  struct Death {
    std::string why;
  };
  /// The device drops so many exposures.
  struct Gap {
    std::uint64_t count = 1;
  };
  /// The frame is cut to half of its JPEG, and torn; a raw one is torn as it is.
  struct Tear {};
  /// From here on these frames, for example of another size.
  struct Change {
    std::vector<SourceFrame> frames;
  };
  struct Event {
    std::uint64_t at = 0;  ///< exposure before which it happens (Tear: to which)
    std::variant<Stall, Death, Gap, Tear, Change> what;
  };
  std::vector<Event> events;  ///< by increasing `at`
};

/// Throws Error (bad input) for a script without frames or with a wrong rate.
std::unique_ptr<FrameSource> make_scripted_source(SourceScript script);

}  // namespace raystage
