// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/time.h"
#include "ingest/sources/ffmpeg_address.h"
#include "ingest/sources/ffmpeg_pointers.h"
#include "ingest/sources/http_reader.h"
#include "ingest/sources/pipe_reader.h"

namespace raystage::ingest {

/// Reads the packets of the best video stream of anything that FFmpeg opens. A separate thread
/// reads a few packets ahead and notes when each was complete. FFmpeg discards a partial packet if
/// it is interrupted, so a caller's timeout must not interrupt FFmpeg.
class FfmpegInput {
 public:
  using Clock = std::chrono::steady_clock;

  struct Packet {
    AvPtr<AVPacket> packet;  ///< null: a frame was larger than allowed, and its bytes are gone
    Nanoseconds arrival_steady = 0;
    bool no_memory = false;  ///< null, because memory for it could not be allocated
  };
  /// Bytes of a frame of a camera whose size is not known yet, and that has no limit of its own.
  static constexpr std::size_t kMaxFrameOfUnknownSize = 16'000'000;
  enum class Outcome { kPacket, kNoData, kEnded, kLost };

  /// Opens the source and leaves in `options` those that FFmpeg did not use. Throws Error (bad
  /// input) if it cannot be opened, has no video or redirects to another host, Error (failed) if no
  /// data arrives within 10 s. `max_frame_bytes`: FFmpeg collects the bytes of a frame until its
  /// end, which a faulty camera may never send; none: four bytes a pixel, at least 4 MB, and
  /// kMaxFrameOfUnknownSize while the size is not known.
  FfmpegInput(FfmpegAddress address, FfmpegOptions& options,
              std::optional<std::size_t> max_frame_bytes);
  ~FfmpegInput();
  FfmpegInput(const FfmpegInput&) = delete;
  FfmpegInput& operator=(const FfmpegInput&) = delete;

  const FfmpegAddress& address() const { return address_; }
  const AVInputFormat& format() const { return *context_->iformat; }
  const AVStream& stream() const { return *context_->streams[stream_]; }
  /// Returns true for files, filter graphs, pipes, and live sources that announced a duration.
  bool is_finite_stream() const { return !address_.is_live() || context_->duration > 0; }
  /// Tells the size of the pictures, where the stream did not state it when it was opened.
  void set_picture_size(int width, int height);
  /// Returns the nominal frames per second, or 0 if unknown.
  double fps() const;

  /// Returns an upper estimate of the bytes of packets read ahead and of FFmpeg's buffers.
  std::size_t memory_overhead() const;
  /// The same of a source that could not be opened yet.
  static std::size_t memory_overhead_before_opening(std::optional<std::size_t> max_frame_bytes);

  /// Starts the reading thread; take() does so if it was not called. A filter graph must wait until
  /// its pictures are wanted: it makes them as fast as it can and may keep them.
  void start();
  /// Waits for a packet until `deadline`; kNoData if none came.
  Outcome take(Packet& packet, Clock::time_point deadline);
  std::string loss_reason();  ///< after kLost
  /// Makes a waiting take() return kNoData, or the next take() if none waits.
  void interrupt();
  /// Forgets an interrupt() that ended another wait.
  void forget_interruption();

 private:
  static int should_interrupt(void* self);
  bool stopping() const;
  bool is_frame_too_large() const;
  void check_redirection() const;
  void open(FfmpegOptions& options);
  void read_as_motion_jpeg(AVDictionary* options);
  bool needs_probing() const;
  void read_packets();
  bool outlives_lack_of_memory(int& lacks) const;
  int read_packet(AVPacket& packet);
  void end(int code);

  FfmpegAddress address_;
  std::atomic<bool> stop_ = false;
  std::atomic<Clock::rep> deadline_{};  ///< of opening
  std::unique_ptr<PipeReader> pipe_;    // both are used by context_
  std::unique_ptr<HttpReader> http_;
  AvPtr<AVIOContext> connection_;  // of context_, where that does not own it
  AvPtr<AVFormatContext> context_;
  bool is_limit_configured_ = false;
  std::atomic<std::size_t> max_frame_bytes_;
  std::size_t pixels_ = 0;        ///< of a picture; 0: not known
  std::int64_t frame_start_ = 0;  ///< bytes of the stream read before the present frame
  int stream_ = -1;
  bool probed_ = false;
  bool seeks_frame_ = false;  ///< after one that was too large

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Packet> packets_;
  bool interrupted_ = false, over_ = false, lost_ = false;
  bool has_failed_to_start_ = false;  // of the thread of take()
  std::string loss_reason_;
  std::thread reader_;
};

}  // namespace raystage::ingest
