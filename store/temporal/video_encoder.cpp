// SPDX-License-Identifier: Apache-2.0
// Encodes pictures by libx265 and libsvtav1. Both in one thread: cameras are encoded in parallel.
// HEVC without B frames, whose packets would not be in the order of their times; an AV1 packet
// has exactly one shown picture in any case.
#include "store/temporal/video_encoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <utility>

#include "base/error.h"
#include "store/temporal/ffmpeg_codec.h"

namespace raystage::store {

namespace {

/// SVT-AV1 has tables of the process, for which encoders that start or end at the same time may
/// race.
std::mutex& starting_and_ending() {
  static std::mutex mutex;
  return mutex;
}

struct SerialDeleter {
  void operator()(AVCodecContext* context) const {
    const std::scoped_lock lock(starting_and_ending());
    avcodec_free_context(&context);
  }
};

}  // namespace

struct VideoEncoder::State {
  VideoSettings settings;
  std::unique_ptr<AVCodecContext, SerialDeleter> session;  // null before the first picture
  ffmpeg::Owned<AVPacket> packet = ffmpeg::owned(av_packet_alloc());
  std::int64_t pushed = 0;
  std::vector<VideoPacket> packets;

  void open(const Planes& planes);
  /// Receives the last packets and ends the encoder, if there is one.
  void close() {
    if (!session) return;
    const auto ended = std::move(session);
    check(avcodec_send_frame(ended.get(), nullptr), "does not finish");
    receive_from(*ended);
  }

  void check(int code, const char* what) const {
    if (code >= 0) return;
    throw Error::failed(fmt::format("the {} encoder {}: {}", name_of(settings.codec), what,
                                    ffmpeg::error_text(code)),
                        "", "Try another rate factor, or the other codec");
  }
  void set(const char* name, const std::string& value) const {
    check(av_opt_set(session->priv_data, name, value.c_str(), 0), "refuses a setting");
  }
  void receive() { receive_from(*session); }
  void receive_from(AVCodecContext& context) {
    for (;;) {
      const int code = avcodec_receive_packet(&context, packet.get());
      if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return;
      check(code, "failed");
      if (packet->pts != static_cast<std::int64_t>(packets.size())) {
        throw Error::failed("the encoder returned pictures in another order", "",
                            "Use the other codec");
      }
      const auto* const bytes = reinterpret_cast<const std::byte*>(packet->data);
      packets.push_back({(packet->flags & AV_PKT_FLAG_KEY) != 0, {bytes, bytes + packet->size}});
      av_packet_unref(packet.get());
    }
  }
};

double max_crf(VideoCodec codec) { return codec == VideoCodec::kHevc ? 51 : 63; }

// FFmpeg takes 0 of SVT-AV1 for no factor.
double min_crf(VideoCodec codec) { return codec == VideoCodec::kHevc ? 0 : 1; }

void VideoEncoder::State::open(const Planes& planes) {
  const bool is_hevc = settings.codec == VideoCodec::kHevc;
  const char* const name = is_hevc ? "libx265" : "libsvtav1";
  const AVCodec* const encoder = avcodec_find_encoder_by_name(name);
  if (encoder == nullptr) {
    throw Error::failed(fmt::format("FFmpeg has no encoder {}", name), "",
                        "Install FFmpeg as scripts/install_packages.sh does");
  }
  session.reset(ffmpeg::owned(avcodec_alloc_context3(encoder)).release());
  AVCodecContext& context = *session;
  context.width = planes.width;
  context.height = planes.height;
  context.pix_fmt = planes.chroma == ChromaStep::k444 ? AV_PIX_FMT_YUV444P : AV_PIX_FMT_YUV420P;
  context.time_base = {1, 30};  // counts pictures; the archive has the times
  context.framerate = {30, 1};
  context.gop_size = settings.group_frames;
  context.thread_count = 1;
  context.color_range = AVCOL_RANGE_JPEG;
  context.colorspace = AVCOL_SPC_SMPTE170M;  // JFIF: BT.601
  context.color_primaries = AVCOL_PRI_BT709;
  context.color_trc = AVCOL_TRC_IEC61966_2_1;
  if (is_hevc) {
    context.max_b_frames = 0;
    set("preset", "fast");
    set("crf", fmt::format("{}", settings.crf));
    set("x265-params",
        fmt::format("log-level=none:info=0:bframes=0:keyint={0}:min-keyint={0}:scenecut=0:"
                    "open-gop=0:repeat-headers=1:pools=none:frame-threads=1",
                    settings.group_frames));
  } else {
    set("preset", "6");
    set("crf", fmt::format("{:.0f}", settings.crf));
    set("svtav1-params", "lp=1");
  }
  const std::scoped_lock lock(starting_and_ending());
  check(avcodec_open2(&context, encoder, nullptr), "does not start");
}

VideoEncoder::VideoEncoder(const VideoSettings& settings) : state_(std::make_unique<State>()) {
  state_->settings = settings;
}

VideoEncoder::~VideoEncoder() {
  try {
    state_->close();  // SVT-AV1 does not end before the end of its pictures
  } catch (...) {     // its packets are not wanted
  }
}

void VideoEncoder::push(const Planes& planes) {
  if (!state_->session) state_->open(planes);
  const AVCodecContext& context = *state_->session;
  const auto frame = ffmpeg::owned(av_frame_alloc());
  AVFrame& picture = *frame;
  picture.format = context.pix_fmt;
  picture.width = context.width;
  picture.height = context.height;
  picture.color_range = context.color_range;
  state_->check(av_frame_get_buffer(&picture, 0), "has no memory");
  for (std::size_t c = 0; c < 3; ++c) {
    const int divisor = c == 0 ? 1 : static_cast<int>(planes.chroma);
    const auto columns = static_cast<std::size_t>(planes.width / divisor);
    for (int y = 0; y < planes.height / divisor; ++y) {
      std::memcpy(picture.data[c] + std::ptrdiff_t{y} * picture.linesize[c],
                  planes.plane[c].data() + static_cast<std::size_t>(y) * columns, columns);
    }
  }
  picture.pts = state_->pushed++;
  state_->check(avcodec_send_frame(state_->session.get(), &picture), "refuses a picture");
  state_->receive();
  // SVT-AV1 makes intra frames that are no key frames where each frame shall be one.
  if (state_->settings.codec == VideoCodec::kAv1 && state_->settings.group_frames == 1) {
    state_->close();
  }
}

std::vector<VideoPacket> VideoEncoder::finish() {
  state_->close();
  if (static_cast<std::int64_t>(state_->packets.size()) != state_->pushed ||
      (state_->pushed > 0 && !state_->packets.front().is_key)) {
    throw Error::failed("the encoder did not return every picture", "", "Use the other codec");
  }
  return std::move(state_->packets);
}

void silence_encoders() {
  av_log_set_level(AV_LOG_QUIET);
  setenv("SVT_LOG", "1", 0);  // errors only
}

}  // namespace raystage::store
