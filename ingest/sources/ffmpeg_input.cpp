// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/ffmpeg_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <new>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"
#include "ingest/sources/ffmpeg_permissions.h"
#include "ingest/sources/frame_source.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;

constexpr auto kOpenWithin = 10s;
constexpr std::size_t kReadAhead = 8;  // packets
constexpr std::size_t kInUse = 2;      // packets: one of each thread
// Bytes of FFmpeg's contexts, and of the packets that wait in a network protocol (udp: 5.4 MB).
constexpr std::size_t kDemuxer = 1 << 20, kNetworkBuffers = 6 << 20;
constexpr std::size_t kHttpBuffers = 2 << 20;  // of HttpTransfer, libcurl and TLS
constexpr std::size_t kGraphPictures = 4;      // in use by filters, 4 bytes per pixel
constexpr int kFrameTooLarge = FFERRTAG('B', 'I', 'G', ' ');

/// Returns whether an address of a transport without a default port names none.
bool lacks_port(const std::string& url) {
  std::array<char, 16> scheme{};
  int port = -1;
  av_url_split(scheme.data(), scheme.size(), nullptr, 0, nullptr, 0, &port, nullptr, 0,
               url.c_str());
  const std::string_view name = scheme.data();
  return port < 0 && (name == "tcp" || name == "udp" || name == "rtp" || name == "srt");
}

bool is_v4l2(const AVInputFormat* format) {
  return format != nullptr && std::strstr(format->name, "v4l2") != nullptr;
}

/// Returns whether FFmpeg refuses an address for reasons that no camera can change. What a network
/// camera sends must never look so.
bool is_fault_of_configuration(int code, const FfmpegAddress& address) {
  using Kind = FfmpegAddress::Kind;
  if (code == AVERROR_PROTOCOL_NOT_FOUND || code == AVERROR_DEMUXER_NOT_FOUND ||
      code == AVERROR_OPTION_NOT_FOUND) {
    return true;
  }
  if (address.kind == Kind::kNetwork) return code == AVERROR(EINVAL) && lacks_port(address.url);
  if (code == AVERROR(EACCES) || code == AVERROR(EPERM)) return true;
  // A device that is not there may be plugged in; one that does not know a value of an option, or a
  // graph that FFmpeg cannot parse, stays so.
  return address.kind == Kind::kFile ? code == AVERROR(ENOENT) : code == AVERROR(EINVAL);
}

}  // namespace

FfmpegInput::FfmpegInput(FfmpegAddress address, FfmpegOptions& options,
                         std::optional<std::size_t> max_frame_bytes)
    : address_(std::move(address)),
      is_limit_configured_(max_frame_bytes.has_value()),
      max_frame_bytes_(max_frame_bytes.value_or(kMaxFrameOfUnknownSize)) {
  deadline_ = (Clock::now() + kOpenWithin).time_since_epoch().count();
  open(options);
  set_picture_size(stream().codecpar->width, stream().codecpar->height);
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

void FfmpegInput::set_picture_size(int width, int height) {
  if (width <= 0 || height <= 0) return;
  pixels_ = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  constexpr std::size_t kLeast = 4'000'000, kBytesPerPixel = 4;
  if (!is_limit_configured_) max_frame_bytes_ = std::max(kLeast, kBytesPerPixel * pixels_);
}

bool FfmpegInput::stopping() const {
  return stop_ || Clock::now().time_since_epoch().count() > deadline_;
}

bool FfmpegInput::is_frame_too_large() const {
  if (!context_ || context_->pb == nullptr) return false;
  // In addition to the frame, FFmpeg has read a buffer, and the bytes to probe.
  const std::int64_t beyond = (probed_ ? context_->probesize : 0) + (std::int64_t{1} << 20);
  const bool is_large_file = address_.kind == FfmpegAddress::Kind::kFile;
  return !is_large_file && context_->pb->pos - frame_start_ >
                               static_cast<std::int64_t>(max_frame_bytes_.load()) + beyond;
}

int FfmpegInput::should_interrupt(void* opaque) {
  const auto& self = *static_cast<const FfmpegInput*>(opaque);
  return self.stopping() || self.is_frame_too_large() ? 1 : 0;
}

/// Throws Error (bad input) if the data come from another host than the address names: FFmpeg
/// follows redirections of RTSP. HttpReader checks those of http before it follows them.
void FfmpegInput::check_redirection() const {
  if (address_.kind != FfmpegAddress::Kind::kNetwork || address_.may_redirect) return;
  const std::string location = context_->url == nullptr ? "" : context_->url;
  if (location.empty() || have_same_host(address_.url, location)) return;
  throw Error::bad_input("the camera redirects to another host, " + without_credentials(location),
                         address_.display_url,
                         "Give that address if you trust it, or set the option "
                         "protocol_whitelist of the source");
}

void FfmpegInput::open(FfmpegOptions& options) {
  const auto refuse = [&](int code, const std::string& what, const std::string& advice) {
    if (code == AVERROR_EXIT || code == AVERROR(ETIMEDOUT)) {
      return Error::failed("no data arrived in time", address_.display_url,
                           "Check the address, and that the camera is switched on and sends");
    }
    return Error::bad_input(fmt::format("{}: {}", what, av_error_text(code)), address_.display_url,
                            advice);
  };
  AVFormatContext* context = check_allocation(avformat_alloc_context());
  context->interrupt_callback = {should_interrupt, this};
  try {
    if (address_.kind == FfmpegAddress::Kind::kPipe) {
      pipe_ = std::make_unique<PipeReader>(address_.url,
                                           [this] { return should_interrupt(this) != 0; });
      context->pb = pipe_->context();
    } else if (address_.is_http()) {
      http_ = std::make_unique<HttpReader>(address_, options,
                                           [this] { return should_interrupt(this) != 0; });
      context->pb = http_->context();
    }
  } catch (...) {
    avformat_free_context(context);
    throw;
  }
  // Otherwise V4L2 waits for a camera that hangs, and cannot be interrupted.
  if (is_v4l2(address_.format)) context->flags |= AVFMT_FLAG_NONBLOCK;
  const char* url = pipe_ ? nullptr : address_.url.c_str();
  AVDictionary* given = nullptr;  // avformat_open_input() removes those that it uses
  av_dict_copy(&given, *options.get(), 0);
  const std::unique_ptr<AVDictionary*, void (*)(AVDictionary**)> freed(&given, av_dict_free);
  // Frees the context itself on failure.
  int code = avformat_open_input(&context, url, address_.format, options.get());
  if (code < 0) {
    if (http_) http_->rethrow_failure();
    for (const char* own : {"protocol_whitelist", "format_whitelist"}) options.remove(own);
    const std::string named = options.names();
    std::string advice = "Check the address, and that the source exists";
    if (address_.kind == FfmpegAddress::Kind::kNetwork) {
      advice =
          "Check the address, and that the camera is switched on and sends video or pictures; "
          "playlists are not read";
    } else if (code == AVERROR_INVALIDDATA) {
      advice = "Check that it holds video or pictures; playlists are not read";
    }
    if (!named.empty()) advice += ". Check also the values of the options " + named;
    const Error error = refuse(code, "the source cannot be opened", advice);
    if (is_fault_of_configuration(code, address_)) throw ConfigurationError(error);
    throw Error(error);
  }
  context_.reset(context);
  check_redirection();
  // FFmpeg reports no error if the interruption comes while it looks for a tag at the start.
  if (stopping()) throw refuse(AVERROR_EXIT, "", "");
  const bool is_stream =
      address_.kind == FfmpegAddress::Kind::kNetwork || address_.kind == FfmpegAddress::Kind::kPipe;
  if (is_stream && std::strcmp(context_->iformat->name, "jpeg_pipe") == 0) {
    read_as_motion_jpeg(given);
    context = context_.get();
  }
  probed_ = needs_probing();
  if (probed_) {
    // Frames read ahead to determine the rate of a live source would arrive late.
    if (address_.kind != FfmpegAddress::Kind::kFile) context->fps_probe_size = 0;
    code = avformat_find_stream_info(context, nullptr);
    if (code < 0 && http_) http_->rethrow_failure();
    if (code < 0) throw refuse(code, "the source is damaged", "Check its sender");
  }
  stream_ = av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (stream_ < 0) {
    throw Error::bad_input("the source has no video stream", address_.display_url,
                           "Choose a source with video");
  }
  for (unsigned i = 0; i < context->nb_streams; ++i) {
    if (static_cast<int>(i) != stream_) context->streams[i]->discard = AVDISCARD_ALL;
  }
}

/// Replaces FFmpeg's reader of still pictures by that of Motion JPEG, on the same connection: it
/// would analyse five seconds of pictures, and could not go on after one that does not end.
void FfmpegInput::read_as_motion_jpeg(AVDictionary* options) {
  AVIOContext* const connection = context_->pb;
  context_->flags |= AVFMT_FLAG_CUSTOM_IO;  // the connection stays open
  context_.reset();
  if (!pipe_ && !http_) connection_.reset(connection);
  AVFormatContext* context = check_allocation(avformat_alloc_context());
  context->interrupt_callback = {should_interrupt, this};
  context->pb = connection;
  AVDictionary* unused = nullptr;
  av_dict_copy(&unused, options, 0);
  const int code = avformat_open_input(&context, nullptr, av_find_input_format("mjpeg"), &unused);
  av_dict_free(&unused);
  if (code < 0) {
    throw Error::bad_input("the source cannot be opened: " + av_error_text(code),
                           address_.display_url, "Set the format of the source");
  }
  context_.reset(context);
}

/// Returns whether packets must be read to determine the codec.
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
  // For these formats the unit of the time stamps is the frame period, unless it is tiny.
  const bool unit_is_period = address_.kind == FfmpegAddress::Kind::kDevice ||
                              address_.kind == FfmpegAddress::Kind::kFilterGraph ||
                              std::strcmp(context_->iformat->name, "rawvideo") == 0;
  const AVRational unit = stream().time_base;
  constexpr int kFastest = 1000;
  if (unit_is_period && unit.num > 0 && unit.den / unit.num <= kFastest) return 1 / av_q2d(unit);
  return 0;
}

std::size_t FfmpegInput::memory_overhead() const {
  using Kind = FfmpegAddress::Kind;
  const AVCodecParameters& video = *stream().codecpar;
  const bool uncompressed =
      video.codec_id == AV_CODEC_ID_RAWVIDEO || video.codec_id == AV_CODEC_ID_WRAPPED_AVFRAME;
  const int raw = uncompressed ? av_image_get_buffer_size(static_cast<AVPixelFormat>(video.format),
                                                          video.width, video.height, 1)
                               : 0;
  // Compressed packets seldom exceed half a byte per pixel, as for JPEG.
  const std::size_t packet = raw > 0 ? static_cast<std::size_t>(raw) : pixels_ / 2;
  std::size_t bytes = (kReadAhead + kInUse) * packet + kDemuxer;
  // The bytes read while probing wait to be read again.
  if (probed_) bytes += static_cast<std::size_t>(context_->probesize);
  if (address_.kind == Kind::kNetwork) bytes += http_ ? kHttpBuffers : kNetworkBuffers;
  // A frame that does not end.
  if (raw == 0 && (address_.kind == Kind::kNetwork || address_.kind == Kind::kPipe)) {
    bytes += is_limit_configured_ ? max_frame_bytes_.load()
                                  : std::max(max_frame_bytes_.load(), kMaxFrameOfUnknownSize);
  }
  if (std::strcmp(context_->iformat->name, "lavfi") == 0) bytes += kGraphPictures * 4 * pixels_;
  return bytes;
}

std::size_t FfmpegInput::memory_overhead_before_opening(
    std::optional<std::size_t> max_frame_bytes) {
  return kDemuxer + kNetworkBuffers + max_frame_bytes.value_or(kMaxFrameOfUnknownSize);
}

void FfmpegInput::start() {
  if (reader_.joinable()) return;
  reader_ = std::thread([this] {
    try {
      read_packets();
    } catch (const std::bad_alloc&) {  // which would end the process
      {
        const std::scoped_lock lock(mutex_);
        over_ = lost_ = true;
      }
      changed_.notify_all();
    }
  });
}

/// Reads a packet of the chosen stream, or returns FFmpeg's error code.
int FfmpegInput::read_packet(AVPacket& packet) {
  std::int64_t position = context_->pb == nullptr ? 0 : context_->pb->pos;
  for (;;) {
    const int code = av_read_frame(context_.get(), &packet);
    if (code == AVERROR(EAGAIN)) {
      if (stop_) return AVERROR_EXIT;
      std::this_thread::sleep_for(1ms);
      continue;
    }
    if (is_frame_too_large() && !stop_) {
      // FFmpeg may return what it has as a frame. Forget it, and go on with what follows.
      av_packet_unref(&packet);
      avformat_flush(context_.get());
      context_->pb->error = 0;
      context_->pb->eof_reached = 0;
      frame_start_ = context_->pb->pos;
      seeks_frame_ = true;
      return kFrameTooLarge;
    }
    // What follows a frame that was dropped is no frame until the next one begins.
    if (seeks_frame_ && code == AVERROR_INVALIDDATA && context_->pb->pos > position) {
      position = context_->pb->pos;
      continue;
    }
    seeks_frame_ = false;
    if (context_->pb != nullptr) frame_start_ = context_->pb->pos;
    if (code < 0 || (packet.stream_index == stream_ && packet.size > 0)) return code;
    av_packet_unref(&packet);
  }
}

/// Returns whether reading goes on after an allocation failed: what a camera sends next may find
/// memory. A filter graph is in an undefined state then, and may be what takes all memory.
bool FfmpegInput::outlives_lack_of_memory(int& lacks) const {
  constexpr int kMost = 1000;  // in succession
  return address_.kind != FfmpegAddress::Kind::kFilterGraph && ++lacks < kMost;
}

void FfmpegInput::read_packets() {
  int lacks = 0;
  while (!stop_) {
    Packet next{AvPtr<AVPacket>(av_packet_alloc()), 0, false};
    const int code = next.packet ? read_packet(*next.packet) : AVERROR(ENOMEM);
    next.arrival_steady = host_steady_now();
    if (code == kFrameTooLarge) {
      next.packet.reset();
    } else if (code == AVERROR(ENOMEM) && outlives_lack_of_memory(lacks)) {
      next.packet.reset();
      next.no_memory = true;
      std::this_thread::sleep_for(1ms);
    } else if (code < 0) {
      end(code);
      return;
    } else if (address_.kind == FfmpegAddress::Kind::kDevice ||
               address_.kind == FfmpegAddress::Kind::kFilterGraph) {
      // The bytes may be one of the driver's few buffers, which are gone when it is closed. Or they
      // belong to a filter graph, which never frees any of the pictures that were in use at once.
      AvPtr<AVPacket> copy(av_packet_alloc());
      if (!copy || av_new_packet(copy.get(), next.packet->size) < 0) {
        end(AVERROR(ENOMEM));
        return;
      }
      std::memcpy(copy->data, next.packet->data, static_cast<std::size_t>(next.packet->size));
      av_packet_copy_props(copy.get(), next.packet.get());
      next.packet = std::move(copy);
    }
    if (next.packet) lacks = 0;
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_ || packets_.size() < kReadAhead; });
    packets_.push_back(std::move(next));
    lock.unlock();
    changed_.notify_all();
  }
}

void FfmpegInput::end(int code) {
  const bool network = address_.kind == FfmpegAddress::Kind::kNetwork;
  const char* at_end = network ? "the sender closed the connection" : "the source ended";
  {
    const std::scoped_lock lock(mutex_);
    over_ = true;
    lost_ = code != AVERROR_EOF || !is_finite_stream();
    loss_reason_ = code == AVERROR_EOF ? at_end : av_error_text(code);
    if (const std::string failure = http_ ? http_->failure() : ""; !failure.empty()) {
      loss_reason_ = failure;
    }
  }
  changed_.notify_all();
}

FfmpegInput::Outcome FfmpegInput::take(Packet& packet, Clock::time_point deadline) {
  if (!has_failed_to_start_) {
    try {
      start();
    } catch (const std::system_error&) {  // no thread can be started
      has_failed_to_start_ = true;
      end(AVERROR(ENOMEM));
    }
  }
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

void FfmpegInput::forget_interruption() {
  const std::scoped_lock lock(mutex_);
  interrupted_ = false;
}

}  // namespace raystage::ingest
