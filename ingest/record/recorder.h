// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "ingest/record/camera_capture.h"
#include "ingest/record/recording_copies.h"
#include "ingest/record/recording_take.h"
#include "schemas/recording_document.h"
#include "store/jpeg/encode.h"

namespace raystage::ingest {

struct RecorderOptions {
  std::size_t memory_bytes = std::size_t{1} << 30;  ///< of all frames of all cameras
  /// Of the whole process until all sources are closed, bytes (MemoryCeiling); default: none.
  std::optional<std::size_t> memory_ceiling;
  bool hold = false;         ///< frames stay in memory until the end
  bool drop_oldest = false;  ///< when memory is full, drop the oldest frame, else the new one
  CameraCapture::LostSourcePolicy when_lost = CameraCapture::LostSourcePolicy::kContinue;
  std::chrono::milliseconds lost_after{5000};
  std::chrono::milliseconds wait_for_memory{10000};  ///< see CameraCapture::Options
  store::JpegEncodeOptions jpeg;                     ///< of raw frames
  int threads = 1;                                   ///< frames encoded in parallel
  /// Frames before this time or before the take's epoch are ignored; default: the time of run().
  std::optional<Nanoseconds> start_utc;
  std::optional<double> duration_s;  ///< from start_utc
  double status_interval_s = 1;
  double flush_interval_s = 1;  ///< of flushing written data to the disk (fdatasync); 0: never
  double drain_timeout_s = 3;   ///< how long writes to a full disk are retried at the end
  bool is_valid(std::string* reason) const;
};

struct RecorderCamera {
  std::string id;
  std::unique_ptr<FrameSource> source;
  CameraCapture::Open reopen;
  std::string absence = {};  ///< why it could not be opened; empty: `source` is open
};

/// Returns the largest size in bytes of a frame that a capture thread holds outside of the budget.
std::size_t frame_bytes(std::size_t pixels, bool jpeg);

/// The state of a running recording, for display.
struct RecorderStatus {
  struct Camera {
    std::string id;
    double fps = 0;  ///< rate of arrival since the previous status
    std::uint64_t arrived = 0, dropped = 0, skipped_by_source = 0;
    /// In the archive: survives a crash of this process. With a mirror: in the take's archive, or
    /// after that was stopped, in the mirror's.
    std::uint64_t stored = 0;
    std::size_t in_memory = 0;  ///< frames and records of missing frames
    CameraCounters::State state = CameraCounters::State::kRunning;
  };
  double seconds = 0;
  std::vector<Camera> cameras;
  std::size_t memory_used = 0, memory_limit = 0;  ///< bytes
  double write_bytes_per_s = 0;
  std::optional<double> seconds_left;  ///< until the memory (buffer_in_memory) or the disk is full
  std::string write_error;             ///< of the disk; empty: none
  std::vector<RecordingCopies::Status> copies;  ///< the take and its mirror; empty without a mirror
};

/// Runs one recording on one node: a thread per source, encoder threads, a writer thread.
class Recorder {
 public:
  /// `mirror`: receives the same as `take`; null: none. Throws Error (bad input) if the memory is
  /// too small for a few frames per camera.
  Recorder(const RecorderOptions& options, std::vector<RecorderCamera> cameras, RecordingTake& take,
           std::string program, RecordingTake* mirror = nullptr);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Returns the memory budget of queued frames in bytes, which is less than the settings' memory.
  std::size_t memory_for_frames() const;

  /// Records until it is stopped, the duration is over, or every source has ended. Returns the
  /// session, which is also written to the take; if that fails, its audit contains the reason.
  /// `status` is called every status_interval_s, `writing` with the fraction of remaining frames
  /// written.
  schemas::RecordingDocument::Session run(
      const std::stop_token& stop, const std::function<void(const RecorderStatus&)>& status = {},
      const std::function<void(double)>& writing = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Returns the JPEG data rate of all sources in bytes per second, measured over `seconds` of frames
/// that are discarded. Returns nothing if a source is not live: it would lose these frames.
std::optional<double> measure_data_rate(std::vector<RecorderCamera>& cameras,
                                        const store::JpegEncodeOptions& jpeg, double seconds);

}  // namespace raystage::ingest
