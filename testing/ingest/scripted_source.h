// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "ingest/sources/frame_source.h"

namespace raystage::testing {

/// The frames and failures of a source in memory, for tests and benchmarks of the recorder.
/// Exposures are counted from 0; those within a gap count too.
struct SourceScript {
  /// At least one frame; they repeat. Only `jpeg` and `raw` are used.
  std::vector<ingest::SourceFrame> frames;
  double fps = 0;                      ///< 0: as fast as they are read
  std::optional<std::uint64_t> count;  ///< exposures until the end; if absent, endless
  /// Number of frames that wait for the reader, as in a driver's buffers. Frames that come when
  /// these are full are dropped, and the counter shows it. 0: unlimited.
  int buffers = 0;
  bool stamps = true;    ///< device_time and sequence are given
  double clock_ppm = 0;  ///< error of the device's clock
  double jitter = 0;     ///< maximum delay of an arrival in seconds, hashed from the exposure
  std::string timestamp_event = "arrival";

  /// The device delivers nothing for some seconds, and drops its exposures during that time.
  struct Stall {
    double seconds = 0;
  };
  /// The device is lost as soon as its buffers are empty.
  struct Death {
    std::string why;
  };
  /// The device drops `count` exposures.
  struct Gap {
    std::uint64_t count = 1;
  };
  /// The frame is torn, and a JPEG is cut to half of its bytes.
  struct Tear {};
  /// Other frames follow, for example of another size.
  struct Change {
    std::vector<ingest::SourceFrame> frames;
  };
  struct Event {
    std::uint64_t at = 0;  ///< the exposure that is torn, or before which the event happens
    std::variant<Stall, Death, Gap, Tear, Change> what;
  };
  std::vector<Event> events;  ///< by increasing `at`
};

/// Opens the source. Throws Error (bad input) if the script has no frames or a wrong rate.
std::unique_ptr<ingest::FrameSource> make_scripted_source(SourceScript script);

}  // namespace raystage::testing
