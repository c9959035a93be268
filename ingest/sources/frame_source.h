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

namespace raystage::ingest {

/// A frame of a source: a JPEG as it arrived, or raw pixels. A torn frame may have neither
/// (`raw.width` is 0) if its data cannot be interpreted.
struct SourceFrame {
  std::vector<std::byte> jpeg;  ///< empty if `raw` is the picture
  store::RawImage raw;
  /// When the frame was complete, by host_steady_now(). A frame that waited in a source that is not
  /// live arrives when it is taken.
  Nanoseconds arrival_steady = 0;
  std::optional<Nanoseconds> device_time;  ///< in ns by the device's clock, from its zero
  std::optional<std::uint64_t> sequence;   ///< the device's frame counter: gaps are drops
  bool torn = false;                       ///< incomplete (lost packets, truncated JPEG)
  bool no_memory = false;  ///< no data, because memory for them could not be allocated
};

/// Properties of an open source.
struct SourceDescription {
  std::string what;           ///< for messages: "v4l2 /dev/video0, mjpeg"
  int width = 0, height = 0;  ///< pixels
  double fps = 0;             ///< nominal; 0 if unknown
  bool delivers_jpeg = false;
  bool live = true;            ///< produces frames without a reader; a file or pipe waits and ends
  bool waits = false;          ///< waits without loss at its producer: a file, but not a pipe
  std::string clock = "host";  ///< as in take.json: "host", "device", "simulated"
  std::string timestamp_event = "arrival";  ///< event of device_time, or else of arrival
};

/// Delivers the frames of one camera to one thread. Only interrupt() is thread-safe.
class FrameSource {
 public:
  enum class Outcome {
    kFrame,   ///< `frame` is filled
    kNoData,  ///< no frame came in time: call again
    kEnded,   ///< the end of a finite source
    kLost     ///< the device or connection is gone; see loss_reason()
  };

  FrameSource() = default;
  virtual ~FrameSource() = default;
  FrameSource(const FrameSource&) = delete;
  FrameSource& operator=(const FrameSource&) = delete;

  virtual const SourceDescription& description() const = 0;
  /// Waits for the next frame for about `patience`. Never throws if a device fails,
  /// only bad_alloc.
  virtual Outcome next(SourceFrame& frame, std::chrono::milliseconds patience) = 0;
  virtual std::string loss_reason() const { return {}; }
  /// Returns an upper estimate of the bytes used in addition to the delivered frames and the next
  /// one: packets read ahead, the decoder's pictures, the driver's buffers.
  virtual std::size_t memory_overhead() const { return 0; }
  /// Returns whether the process survives if an allocation of the source fails: next() then reports
  /// the frame or the source as lost, or throws bad_alloc.
  virtual bool survives_failed_allocations() const { return true; }
  /// Makes a waiting next() return soon.
  virtual void interrupt() {}
};

/// Returns the host time in ns since 1970.
Nanoseconds host_utc_now();

/// Returns the time since this computer was started, also while it slept, in ns. Nobody sets it.
Nanoseconds host_steady_now();

}  // namespace raystage::ingest
