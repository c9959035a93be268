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
#include "ingest/record/recording_take.h"
#include "schemas/recording_document.h"
#include "store/jpeg/encode.h"

namespace raystage {

struct RecorderSettings {
  std::size_t memory_bytes = std::size_t{1} << 30;  ///< for all frames of all cameras
  bool hold = false;                                ///< frames stay in memory until the end
  bool drop_oldest = false;  ///< what gives way when the memory is full: else the new frame
  CameraCapture::LostSourcePolicy when_lost = CameraCapture::LostSourcePolicy::kContinue;
  std::chrono::milliseconds lost_after{5000};
  std::chrono::milliseconds wait_for_memory{10000};  ///< of sources that wait, see CameraCapture
  JpegEncodeSettings jpeg;                           ///< of raw frames
  int threads = 1;                                   ///< frames encoded at once
  /// Earlier frames do not count, nor those before the take's epoch; without: from run() on.
  std::optional<Nanoseconds> start_utc;
  std::optional<double> duration_s;  ///< from there
  double status_interval_s = 1;
  double flush_interval_s = 1;  ///< safe against power loss that often; 0: never
  double drain_timeout_s = 3;   ///< how long a full disk is tried at the end
};

struct RecorderCamera {
  std::string id;
  std::unique_ptr<FrameSource> source;
  CameraCapture::Open reopen;
};

/// The state of a recording.
struct RecorderStatus {
  struct Camera {
    std::string id;
    double fps = 0;  ///< frames arrived, over the time since the status before
    std::uint64_t arrived = 0, dropped = 0, skipped_by_source = 0;
    std::uint64_t stored = 0;   ///< in the archive: outlives this process
    std::size_t in_memory = 0;  ///< frames and records
    CameraCounters::State state = CameraCounters::State::kRunning;
  };
  double seconds = 0;
  std::vector<Camera> cameras;
  std::size_t memory_used = 0, memory_limit = 0;  ///< bytes
  double write_bytes_per_s = 0;                   ///< bytes
  std::optional<double> seconds_left;             ///< until memory (hold) or disk is full
  std::string write_error;                        ///< of the disk; empty: none
};

/// Runs one recording on one node: a thread per source, encoders, one writer.
class Recorder {
 public:
  /// Throws Error (bad input) where the memory cannot hold even a few frames a camera.
  Recorder(const RecorderSettings& settings, std::vector<RecorderCamera> cameras,
           RecordingTake& take, std::string program);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Bytes that all frames together may take: less than the settings' memory.
  std::size_t memory_for_frames() const;

  /// Until stopped, the duration is over, or every source has ended. Returns the account, which is
  /// in the take too, or says in its audit why not. `status` is called that often, `writing` with
  /// the part done while what is left in memory goes to disk.
  RecordingDocument::Session run(const std::stop_token& stop,
                                 const std::function<void(const RecorderStatus&)>& status = {},
                                 const std::function<void(double)>& writing = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Bytes of JPEG a second that the sources will make, from `seconds` of their frames, which are
/// thrown away. Nothing where a source is not live: its frames would be missing.
std::optional<double> measure_data_rate(std::vector<RecorderCamera>& cameras,
                                        const JpegEncodeSettings& jpeg, double seconds);

}  // namespace raystage
