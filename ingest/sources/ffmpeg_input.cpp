// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/ffmpeg_input.h"

#include <fmt/format.h>

#include <cstring>
#include <utility>

#include "base/error.h"
#include "ingest/sources/frame_source.h"

namespace raystage {
namespace {

using namespace std::chrono_literals;

constexpr auto kOpenWithin = 10s;
constexpr std::size_t kReadAhead = 8;  // packets
constexpr std::size_t kInHands = 2;    // of the reading thread, and of who takes them
// FFmpeg's contexts and buffers: of a network protocol the packets that wait (udp keeps 5.4 MB).
constexpr std::size_t kDemuxer = 1 << 20, kNetworkBuffers = 6 << 20;
constexpr std::size_t kGraphPictures = 4;  // that filters hold, 4 bytes a pixel

bool is_v4l2(const AVInputFormat* format) {
  return format != nullptr && std::strstr(format->name, "v4l2") != nullptr;
}

}  // namespace

FfmpegInput::FfmpegInput(FfmpegAddress address, FfmpegOptions& options)
    : address_(std::move(address)) {
  deadline_ = (Clock::now() + kOpenWithin).time_since_epoch().count();
  open(options);
  deadline_ = Clock::time_point::max().time_since_epoch().count();
}

FfmpegInput::~FfmpegInput() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (reader_.joinable()) reader_.join();
}

bool FfmpegInput::stopping() const {
  return stop_ || Clock::now().time_since_epoch().count() > deadline_;
}

int FfmpegInput::should_interrupt(void* self) {
  return static_cast<const FfmpegInput*>(self)->stopping() ? 1 : 0;
}

void FfmpegInput::open(FfmpegOptions& options) {
  const auto refuse = [&](int code, const std::string& what, const std::string& advice) {
    if (code == AVERROR_EXIT || code == AVERROR(ETIMEDOUT)) {
      return Error::failed("nothing came in time", address_.display_url,
                           "Check that the camera is switched on and sends, and the address");
    }
    return Error::bad_input(fmt::format("{}: {}", what, av_error_text(code)), address_.display_url,
                            advice);
  };
  AVFormatContext* context = check_allocation(avformat_alloc_context());
  context->interrupt_callback = {should_interrupt, this};
  if (address_.kind == FfmpegAddress::Kind::kPipe) {
    try {
      pipe_ = std::make_unique<PipeReader>(address_.url, [this] { return stopping(); });
    } catch (...) {
      avformat_free_context(context);
      throw;
    }
    context->pb = pipe_->context();
  }
  // V4L2 otherwise waits for a camera that hangs, with no way to stop it.
  if (is_v4l2(address_.format)) context->flags |= AVFMT_FLAG_NONBLOCK;
  const char* url = pipe_ ? nullptr : address_.url.c_str();
  // Frees the context itself where it fails.
  int code = avformat_open_input(&context, url, address_.format, options.get());
  if (code < 0) {
    const std::string named = options.names();
    throw refuse(code, "the source cannot be opened",
                 named.empty() ? "Check the address, and that the source is there"
                               : "Check the address, and the values of the options " + named);
  }
  context_.reset(context);
  // FFmpeg looks for a tag before the first bytes, and takes the end of our patience for none.
  if (stopping()) throw refuse(AVERROR_EXIT, "", "");
  probed_ = needs_probing();
  if (probed_) {
    // Frames read ahead to find the rate of a live source would arrive late.
    if (address_.kind != FfmpegAddress::Kind::kFile) context->fps_probe_size = 0;
    code = avformat_find_stream_info(context, nullptr);
    if (code < 0) throw refuse(code, "the source is damaged", "Check what sends it");
  }
  stream_ = av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (stream_ < 0) {
    throw Error::bad_input("there is no video in this source", address_.display_url,
                           "Check that it is the right one");
  }
  for (unsigned i = 0; i < context->nb_streams; ++i) {
    if (static_cast<int>(i) != stream_) context->streams[i]->discard = AVDISCARD_ALL;
  }
}

/// Whether packets must be read to know what is in them.
bool FfmpegInput::needs_probing() const {
  if (address_.kind == FfmpegAddress::Kind::kFile) return true;
  if ((context_->ctx_flags & AVFMTCTX_NOHEADER) != 0) return true;
  for (unsigned i = 0; i < context_->nb_streams; ++i) {
    const AVCodecParameters& parameters = *context_->streams[i]->codecpar;
    if (parameters.codec_type == AVMEDIA_TYPE_VIDEO && parameters.codec_id != AV_CODEC_ID_NONE) {
      return false;
    }
  }
  return true;
}

double FfmpegInput::fps() const {
  for (const AVRational rate : {stream().avg_frame_rate, stream().r_frame_rate}) {
    if (rate.num > 0 && rate.den > 0) return av_q2d(rate);
  }
  // Of these the tick of the time stamps is the period of the frames, where it is not tiny.
  const bool by_ticks = address_.kind == FfmpegAddress::Kind::kDevice ||
                        address_.kind == FfmpegAddress::Kind::kFilterGraph ||
                        std::strcmp(context_->iformat->name, "rawvideo") == 0;
  const AVRational tick = stream().time_base;
  constexpr int kFastest = 1000;
  if (by_ticks && tick.num > 0 && tick.den / tick.num <= kFastest) return 1 / av_q2d(tick);
  return 0;
}

std::size_t FfmpegInput::memory_overhead() const {
  using Kind = FfmpegAddress::Kind;
  const AVCodecParameters& video = *stream().codecpar;
  const auto pixels =
      static_cast<std::size_t>(video.width) * static_cast<std::size_t>(video.height);
  const bool plain =
      video.codec_id == AV_CODEC_ID_RAWVIDEO || video.codec_id == AV_CODEC_ID_WRAPPED_AVFRAME;
  const int raw = plain ? av_image_get_buffer_size(static_cast<AVPixelFormat>(video.format),
                                                   video.width, video.height, 1)
                        : 0;
  // Compressed ones: as for JPEG, half a byte a pixel is much.
  const std::size_t packet = raw > 0 ? static_cast<std::size_t>(raw) : pixels / 2;
  std::size_t bytes = (kReadAhead + kInHands) * packet + kDemuxer;
  // What was read to find out what there is waits to be read again.
  if (probed_) bytes += static_cast<std::size_t>(context_->probesize);
  if (address_.kind == Kind::kNetwork) bytes += kNetworkBuffers;
  if (std::strcmp(context_->iformat->name, "lavfi") == 0) bytes += kGraphPictures * 4 * pixels;
  return bytes;
}

void FfmpegInput::start() {
  reader_ = std::thread([this] { read_packets(); });
}

/// One packet of ours, or FFmpeg's reason why there is none.
int FfmpegInput::read_packet(AVPacket& packet) {
  for (;;) {
    const int code = av_read_frame(context_.get(), &packet);
    if (code == AVERROR(EAGAIN)) {
      if (stop_) return AVERROR_EXIT;
      std::this_thread::sleep_for(1ms);
      continue;
    }
    if (code < 0 || (packet.stream_index == stream_ && packet.size > 0)) return code;
    av_packet_unref(&packet);
  }
}

void FfmpegInput::read_packets() {
  while (!stop_) {
    Packet next{AvPtr<AVPacket>(av_packet_alloc()), 0};
    const int code = next.packet ? read_packet(*next.packet) : AVERROR(ENOMEM);
    if (code < 0) {
      end(code);
      return;
    }
    next.arrival_utc = host_utc_now();
    if (address_.kind == FfmpegAddress::Kind::kDevice ||
        address_.kind == FfmpegAddress::Kind::kFilterGraph) {
      // The bytes may be the driver's own, which has few such buffers and takes them back when it
      // is closed; or a graph's, which keeps as many as were ever out at once.
      AvPtr<AVPacket> copy(av_packet_alloc());
      if (!copy || av_new_packet(copy.get(), next.packet->size) < 0) {
        end(AVERROR(ENOMEM));
        return;
      }
      std::memcpy(copy->data, next.packet->data, static_cast<std::size_t>(next.packet->size));
      av_packet_copy_props(copy.get(), next.packet.get());
      next.packet = std::move(copy);
    }
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_ || packets_.size() < kReadAhead; });
    packets_.push_back(std::move(next));
    lock.unlock();
    changed_.notify_all();
  }
}

void FfmpegInput::end(int code) {
  const bool network = address_.kind == FfmpegAddress::Kind::kNetwork;
  const char* at_end = network ? "the other side closed the connection" : "the source ended";
  {
    const std::scoped_lock lock(mutex_);
    over_ = true;
    lost_ = code != AVERROR_EOF || !is_finite_stream();
    loss_reason_ = code == AVERROR_EOF ? at_end : av_error_text(code);
  }
  changed_.notify_all();
}

FfmpegInput::Outcome FfmpegInput::take(Packet& packet, Clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  changed_.wait_until(lock, deadline,
                      [this] { return !packets_.empty() || over_ || interrupted_; });
  interrupted_ = false;
  if (!packets_.empty()) {
    packet = std::move(packets_.front());
    packets_.pop_front();
    lock.unlock();
    changed_.notify_all();
    return Outcome::kPacket;
  }
  if (!over_) return Outcome::kNoData;
  return lost_ ? Outcome::kLost : Outcome::kEnded;
}

std::string FfmpegInput::loss_reason() {
  const std::scoped_lock lock(mutex_);
  return lost_ ? loss_reason_ : std::string();
}

void FfmpegInput::interrupt() {
  {
    const std::scoped_lock lock(mutex_);
    interrupted_ = true;
  }
  changed_.notify_all();
}

}  // namespace raystage
