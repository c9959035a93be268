// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "store/jpeg/raw_image.h"

namespace raystage {

/// A frame of a source: a JPEG as it arrived, or raw pixels. A torn frame may have neither
/// (`raw.width` is 0) if its data cannot be interpreted.
struct SourceFrame {
  std::vector<std::byte> jpeg;  ///< empty where `raw` is the picture
  RawImage raw;
  /// Host clock when it was whole, since 1970. What waited in a source that is not live arrives
  /// when it is taken.
  Nanoseconds arrival_utc = 0;
  std::optional<Nanoseconds> device_time;  ///< by the device's own clock, from its own zero
  std::optional<std::uint64_t> sequence;   ///< the device's frame counter: a gap is a drop
  bool torn = false;                       ///< arrived incomplete (lost packets, cut JPEG)
};

/// What is known of a source once it is open.
struct SourceDescription {
  std::string what;           ///< for people: "v4l2 /dev/video0, mjpeg"
  int width = 0, height = 0;  ///< pixels
  double fps = 0;             ///< nominal; 0 where unknown
  bool delivers_jpeg = false;
  bool live = true;  ///< goes on where nobody reads; else it waits, and has an end: a file, a pipe
  bool waits = false;  ///< not live, and nobody behind it loses anything meanwhile: not a pipe
  std::string clock = "host";               ///< take.json's words: "host", "device", "simulated"
  std::string timestamp_event = "arrival";  ///< what device_time (or else arrival) marks
};

/// The source of the frames of one camera. Used by one thread; only `interrupt` may be called from
/// another.
class FrameSource {
 public:
  enum class Outcome {
    kFrame,   ///< `frame` is filled
    kNoData,  ///< none came within the time given: ask again
    kEnded,   ///< the end of a finite source
    kLost     ///< the device or connection is gone; loss_reason() says more
  };

  FrameSource() = default;
  virtual ~FrameSource() = default;
  FrameSource(const FrameSource&) = delete;
  FrameSource& operator=(const FrameSource&) = delete;

  virtual const SourceDescription& description() const = 0;
  /// Waits for the next frame, at most about `patience`. Never throws for what a device does.
  virtual Outcome next(SourceFrame& frame, std::chrono::milliseconds patience) = 0;
  virtual std::string loss_reason() const { return {}; }
  /// Bytes that it takes beside the frames it has delivered and the one in its hands: what it reads
  /// ahead, its decoder's pictures, its driver's buffers. An estimate, from above.
  virtual std::size_t memory_overhead() const { return 0; }
  /// Makes a waiting next() return soon. Thread-safe.
  virtual void interrupt() {}
};

/// Host clock, ns since 1970.
Nanoseconds host_utc_now();

}  // namespace raystage
