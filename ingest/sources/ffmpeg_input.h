// SPDX-License-Identifier: Apache-2.0
// Inside ingest/sources only.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "base/time.h"
#include "ingest/sources/ffmpeg_address.h"
#include "ingest/sources/ffmpeg_pointers.h"
#include "ingest/sources/pipe_reader.h"

namespace raystage {

/// The packets of the first video stream of anything that FFmpeg opens. A thread of its own reads
/// ahead a little and notes when each packet was whole: FFmpeg gives up a packet half way where its
/// reading is cut short, so no caller's patience may reach into it.
class FfmpegInput {
 public:
  using Clock = std::chrono::steady_clock;

  struct Packet {
    AvPtr<AVPacket> packet;
    Nanoseconds arrival_utc = 0;
  };
  enum class Outcome { kPacket, kNoData, kEnded, kLost };

  /// Opens within 10 s or throws Error: bad input where there is nothing to open or no video in it,
  /// failed where nothing came in time. What is left in `options` nobody knew so far.
  FfmpegInput(FfmpegAddress address, FfmpegOptions& options);
  ~FfmpegInput();
  FfmpegInput(const FfmpegInput&) = delete;
  FfmpegInput& operator=(const FfmpegInput&) = delete;

  const FfmpegAddress& address() const { return address_; }
  const AVInputFormat& format() const { return *context_->iformat; }
  const AVStream& stream() const { return *context_->streams[stream_]; }
  /// Files, graphs and pipes end. A camera does not, unless it said how much it would send.
  bool is_finite_stream() const { return !address_.is_live() || context_->duration > 0; }
  /// Nominal frames per second; 0: unknown.
  double fps() const;

  /// Bytes of what is read ahead and of FFmpeg's own, at most about.
  std::size_t memory_overhead() const;

  /// Starts reading; packets may be taken from now on.
  void start();
  Outcome take(Packet& packet, Clock::time_point deadline);
  /// After kLost.
  std::string loss_reason();
  /// Makes a waiting take() return kNoData, or else the next one.
  void interrupt();

 private:
  static int should_interrupt(void* self);
  bool stopping() const;
  void open(FfmpegOptions& options);
  bool needs_probing() const;
  void read_packets();
  int read_packet(AVPacket& packet);
  void end(int code);

  FfmpegAddress address_;
  std::atomic<bool> stop_ = false;
  std::atomic<Clock::rep> deadline_{};  ///< of opening
  std::unique_ptr<PipeReader> pipe_;
  AvPtr<AVFormatContext> context_;
  int stream_ = -1;
  bool probed_ = false;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Packet> packets_;
  bool interrupted_ = false, over_ = false, lost_ = false;
  std::string loss_reason_;
  std::thread reader_;
};

}  // namespace raystage
