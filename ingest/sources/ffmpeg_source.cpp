// SPDX-License-Identifier: Apache-2.0
// Delivers the frames of an FFmpeg stream as a source: Motion JPEG byte for byte, other codecs
// decoded and converted (pixel_conversion.h). Cost: one decode per frame on the caller's thread,
// except for Motion JPEG.
#include "ingest/sources/ffmpeg_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"
#include "ingest/sources/ffmpeg_input.h"
#include "ingest/sources/ffmpeg_permissions.h"
#include "ingest/sources/interruptible_wait.h"
#include "ingest/sources/jpeg_markers.h"
#include "ingest/sources/pixel_conversion.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Clock = FfmpegInput::Clock;

constexpr auto kFirstFrameWithin = 10s;
constexpr AVRational kNanosecond{1, 1'000'000'000};

/// Clock of the time stamps of an input format; kNone if they are counted or made up.
enum class CaptureClock { kNone, kHost, kDevice };

CaptureClock clock_of(const FfmpegInput& input) {
  const std::string_view name = input.format().name;
  if (name.find("v4l2") != name.npos) return CaptureClock::kHost;  // monotonic, of the kernel
  if (input.address().kind != FfmpegAddress::Kind::kNetwork) return CaptureClock::kNone;
  const bool by_sender = name == "rtsp" || name == "rtp" || name == "sdp" || name == "mpegts";
  return by_sender ? CaptureClock::kDevice : CaptureClock::kNone;
}

/// Returns the address, and sets the options with which FFmpeg may open it.
FfmpegAddress prepare(const schemas::RecordConfig::FfmpegSource& source,
                      const std::filesystem::path& base, SourcePermissions permissions,
                      FfmpegOptions& options) {
  FfmpegAddress address = resolve_ffmpeg_address(source, base);
  if (!permissions.filters_with_files) check_filters(source, address);
  for (const auto& [name, value] : source.options) options.set(name, value);
  limit_to_address(source, address, options);
  return address;
}

std::optional<std::size_t> max_frame_bytes(const schemas::RecordConfig::FfmpegSource& source) {
  if (!source.max_frame_mb) return std::nullopt;
  return static_cast<std::size_t>(*source.max_frame_mb * 1e6);
}

class FfmpegSource final : public FrameSource {
 public:
  FfmpegSource(const schemas::RecordConfig::FfmpegSource& source, const std::filesystem::path& base,
               SourcePermissions permissions)
      : realtime_(source.realtime),
        input_(prepare(source, base, permissions, options_), options_, max_frame_bytes(source)),
        clock_(clock_of(input_)) {
    const AVCodecParameters& parameters = *input_.stream().codecpar;
    if (parameters.codec_id != AV_CODEC_ID_MJPEG) open_decoder(parameters);
    if (const std::string unknown = options_.names(); !unknown.empty()) {
      throw ConfigurationError(
          Error::bad_input(fmt::format("FFmpeg has no such options for this source: {}", unknown),
                           input_.address().display_url,
                           "Remove or correct them; `ffmpeg -h demuxer=NAME` lists the options"));
    }
    // A wall clock that FFmpeg reads at arrival adds nothing to arrival_steady.
    if (source.options.contains("use_wallclock_as_timestamps")) clock_ = CaptureClock::kNone;
    describe(parameters);
    if (input_.address().kind != FfmpegAddress::Kind::kFilterGraph) input_.start();
    if (description_.width <= 0 || description_.height <= 0) find_size();
  }

  const SourceDescription& description() const override { return description_; }

  Outcome next(SourceFrame& frame, std::chrono::milliseconds patience) override {
    const Clock::time_point deadline = Clock::now() + patience;
    if (since_ == 0) since_ = host_steady_now();
    if (!has_held_) {
      if (const Outcome outcome = try_produce(deadline); outcome != Outcome::kFrame) {
        pace_.forget();  // an interruption ends one wait
        return outcome;
      }
      has_held_ = true;
    }
    if (realtime_) {
      const Clock::time_point due = due_time();
      if (due > Clock::now() && (!pace_.until(std::min(due, deadline)) || due > deadline)) {
        input_.forget_interruption();
        return Outcome::kNoData;
      }
      held_.arrival_steady = host_steady_now();
    }
    // A frame read ahead of a request must not count as a frame of the past.
    if (!description_.live && held_.arrival_steady <= since_)
      held_.arrival_steady = host_steady_now();
    since_ = 0;
    frame = std::move(held_);
    held_ = {};
    has_held_ = false;
    return Outcome::kFrame;
  }

  std::string loss_reason() const override { return loss_reason_; }
  std::size_t memory_overhead() const override {
    return input_.memory_overhead() + decoder_memory();
  }

  void interrupt() override {
    input_.interrupt();
    pace_.interrupt();
  }

 private:
  void open_decoder(const AVCodecParameters& parameters) {
    const AVCodec* decoder = avcodec_find_decoder(parameters.codec_id);
    if (decoder == nullptr) {
      throw Error::bad_input(
          fmt::format("FFmpeg has no decoder for {}", avcodec_get_name(parameters.codec_id)),
          input_.address().display_url, "Set the camera to a codec that `ffmpeg -decoders` lists");
    }
    codec_.reset(check_allocation(avcodec_alloc_context3(decoder)));
    codec_->thread_count = 1;  // every camera has a decoder
    int code = avcodec_parameters_to_context(codec_.get(), &parameters);
    codec_->pkt_timebase = input_.stream().time_base;
    if (input_.address().is_live()) codec_->flags |= AV_CODEC_FLAG_LOW_DELAY;
    if (code >= 0) code = avcodec_open2(codec_.get(), decoder, options_.get());
    if (code < 0) {
      throw Error::bad_input("the decoder does not start: " + av_error_text(code),
                             input_.address().display_url, "Check the values of the options");
    }
    picture_.reset(check_allocation(av_frame_alloc()));
  }

  void describe(const AVCodecParameters& parameters) {
    // FFmpeg lists all formats of one reader: "video4linux2,v4l2", "mov,mp4,m4a,...".
    std::string format = input_.format().name;
    format = format.ends_with(",v4l2") ? "v4l2" : format.substr(0, format.find(','));
    description_.what = fmt::format("{} {}, {}", format, input_.address().display_url,
                                    avcodec_get_name(parameters.codec_id));
    description_.width = parameters.width;
    description_.height = parameters.height;
    description_.fps = input_.fps();
    description_.delivers_jpeg = !codec_;
    description_.live = !input_.is_finite_stream();
    description_.waits = input_.address().kind == FfmpegAddress::Kind::kFile ||
                         input_.address().kind == FfmpegAddress::Kind::kFilterGraph;
    description_.clock = clock_ == CaptureClock::kDevice ? "device" : "host";
    description_.timestamp_event = clock_ == CaptureClock::kNone ? "arrival" : "unknown";
  }

  /// Returns an upper estimate of the bytes of the decoder's pictures.
  std::size_t decoder_memory() const {
    if (!codec_) return 0;
    // One picture is decoded, one delivered. Codecs with prediction keep 16 reference pictures; the
    // motion vectors add half of each picture's bytes.
    constexpr std::size_t kIntra = 2, kPredicted = (16 + 2) * 3 / 2, kMaxBytesPerPixel = 4;
    const AVCodecDescriptor* codec = avcodec_descriptor_get(codec_->codec_id);
    const bool intra = codec != nullptr && (codec->props & AV_CODEC_PROP_INTRA_ONLY) != 0;
    const int known =
        av_image_get_buffer_size(codec_->pix_fmt, description_.width, description_.height, 32);
    const std::size_t picture = known > 0 ? static_cast<std::size_t>(known)
                                          : kMaxBytesPerPixel *
                                                static_cast<std::size_t>(description_.width) *
                                                static_cast<std::size_t>(description_.height);
    return (intra ? kIntra : kPredicted) * picture;
  }

  /// Takes the size from the first frame, for streams that do not report it earlier.
  void find_size() {
    const Outcome outcome = produce(Clock::now() + kFirstFrameWithin);
    if (outcome != Outcome::kFrame) {
      throw Error::failed(
          outcome == Outcome::kNoData
              ? "no frame arrived within 10 s"
              : fmt::format("no frame arrived: {}",
                            outcome == Outcome::kLost ? loss_reason_ : "the stream ended"),
          input_.address().display_url, "Check that the camera is switched on and sends");
    }
    has_held_ = true;
    const JpegMarkerInfo markers = scan_jpeg_markers(held_.jpeg);
    description_.width = codec_ ? held_.raw.width : markers.width;
    description_.height = codec_ ? held_.raw.height : markers.height;
    input_.set_picture_size(description_.width, description_.height);
  }

  /// The same as produce(); a frame for which there is no memory is reported as such.
  Outcome try_produce(Clock::time_point deadline) {
    try {
      return produce(deadline);
    } catch (const std::bad_alloc&) {
      hold_torn_frame();
      held_.no_memory = true;
      return Outcome::kFrame;
    }
  }

  /// Waits until `deadline` for the next frame and stores it in held_.
  Outcome produce(Clock::time_point deadline) {
    for (;;) {
      if (codec_) {
        const int code = avcodec_receive_frame(codec_.get(), picture_.get());
        if (code == 0) {
          hold_picture();
          return Outcome::kFrame;
        }
        if (code == AVERROR_EOF) return ending_;
        if (code != AVERROR(EAGAIN)) {
          hold_torn_frame();
          held_.no_memory = code == AVERROR(ENOMEM);
          return Outcome::kFrame;
        }
      }
      FfmpegInput::Packet next;
      switch (input_.take(next, deadline)) {
        case FfmpegInput::Outcome::kNoData:
          return Outcome::kNoData;
        case FfmpegInput::Outcome::kLost:
          ending_ = Outcome::kLost;
          loss_reason_ = input_.loss_reason();
          [[fallthrough]];
        case FfmpegInput::Outcome::kEnded:
          // The decoder may still have pictures.
          if (!codec_ || avcodec_send_packet(codec_.get(), nullptr) < 0) return ending_;
          break;
        case FfmpegInput::Outcome::kPacket:
          if (!next.packet) {  // larger than allowed, or there is no memory for it
            packet_arrival_ = next.arrival_steady;
            hold_torn_frame();
            held_.no_memory = next.no_memory;
            return Outcome::kFrame;
          }
          if (!codec_) {
            hold_jpeg(next);
            return Outcome::kFrame;
          }
          if (!send(next)) return Outcome::kFrame;
          break;
      }
    }
  }

  /// Decodes a packet. If it is not a picture, returns false with a torn frame in held_.
  bool send(const FfmpegInput::Packet& next) {
    packet_arrival_ = next.arrival_steady;
    packet_torn_ = (next.packet->flags & AV_PKT_FLAG_CORRUPT) != 0;
    codec_->reordered_opaque = next.arrival_steady;  // returned with the picture
    if (avcodec_send_packet(codec_.get(), next.packet.get()) >= 0) return true;
    hold_torn_frame();
    return false;
  }

  void hold_jpeg(const FfmpegInput::Packet& next) {
    held_ = {};
    packet_arrival_ = next.arrival_steady;
    const auto* bytes = reinterpret_cast<const std::byte*>(next.packet->data);
    held_.jpeg.assign(bytes, bytes + next.packet->size);
    held_.arrival_steady = next.arrival_steady;
    held_.torn =
        (next.packet->flags & AV_PKT_FLAG_CORRUPT) != 0 || !scan_jpeg_markers(held_.jpeg).whole;
    stamp(next.packet->pts);
  }

  void hold_picture() {
    held_ = {};
    // A separate AVFrame, so that the decoder can continue while this one waits.
    const std::shared_ptr<AVFrame> owner(check_allocation(av_frame_alloc()), AvDeleter{});
    av_frame_move_ref(owner.get(), picture_.get());
    held_.torn = owner->decode_error_flags != 0 || (owner->flags & AV_FRAME_FLAG_CORRUPT) != 0 ||
                 packet_torn_;
    if (!converter_.convert(*owner, owner, held_.raw)) held_.torn = true;
    // A decoder never frees pictures that were in use at once. With the frames that wait to be
    // written in them, each decoder could keep as much as the memory budget of all cameras.
    const bool borrowed = held_.raw.owner == owner && codec_->codec_id != AV_CODEC_ID_RAWVIDEO;
    if (borrowed && !converter_.convert_to(held_.raw.format, *owner, held_.raw)) held_.torn = true;
    held_.arrival_steady = owner->reordered_opaque > 0 ? owner->reordered_opaque : packet_arrival_;
    stamp(owner->best_effort_timestamp);
  }

  /// Stores a torn frame for data that is not a picture.
  void hold_torn_frame() {
    held_ = {};
    held_.torn = true;
    held_.arrival_steady = packet_arrival_;
    stamp(AV_NOPTS_VALUE);
  }

  void stamp(std::int64_t pts) {
    media_time_.reset();
    if (pts != AV_NOPTS_VALUE) {
      media_time_ = av_rescale_q(pts, input_.stream().time_base, kNanosecond);
    }
    if (clock_ != CaptureClock::kNone) held_.device_time = media_time_;
    const double fps = description_.fps > 0 ? description_.fps : 25;  // FFmpeg's default
    if (!media_time_ || *media_time_ < last_media_time_) {
      media_time_ = last_media_time_ + std::llround(kNanosecondsPerSecond / fps);
    }
    last_media_time_ = *media_time_;
  }

  Clock::time_point due_time() {
    if (!playing_) {
      playing_ = true;
      first_media_time_ = last_media_time_;
      start_ = Clock::now();
    }
    return start_ + std::chrono::nanoseconds(last_media_time_ - first_media_time_);
  }

  bool realtime_;
  FfmpegOptions options_;
  FfmpegInput input_;
  CaptureClock clock_;
  AvPtr<AVCodecContext> codec_;  ///< null for Motion JPEG
  AvPtr<AVFrame> picture_;
  PixelConverter converter_;
  SourceDescription description_;
  SourceFrame held_;
  bool has_held_ = false;
  Nanoseconds since_ = 0;  ///< start of the wait for the next frame; 0: not waiting
  Nanoseconds packet_arrival_ = 0;
  bool packet_torn_ = false;
  Outcome ending_ = Outcome::kEnded;
  std::string loss_reason_;
  InterruptibleWait pace_;
  bool playing_ = false;
  std::optional<Nanoseconds> media_time_;
  Nanoseconds last_media_time_ = 0, first_media_time_ = 0;
  Clock::time_point start_;
};

}  // namespace

std::unique_ptr<FrameSource> open_ffmpeg_source(const schemas::RecordConfig::FfmpegSource& source,
                                                const std::filesystem::path& base,
                                                SourcePermissions permissions) {
  av_log_set_level(AV_LOG_QUIET);  // our Error reports failures once
  return std::make_unique<FfmpegSource>(source, base, permissions);
}

std::size_t memory_overhead_before_opening(const schemas::RecordConfig::FfmpegSource& source) {
  return FfmpegInput::memory_overhead_before_opening(max_frame_bytes(source));
}

}  // namespace raystage::ingest
