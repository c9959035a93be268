// SPDX-License-Identifier: Apache-2.0
#include "ingest/movie_reader.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

#include <fmt/format.h>

#include <array>
#include <string>
#include <utility>

#include "base/error.h"

namespace raystage {
namespace {

struct FormatCloser {
  void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
};
struct CodecCloser {
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
};
struct FrameFreer {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};
struct PacketFreer {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};
struct ScalerFreer {
  void operator()(SwsContext* context) const { sws_freeContext(context); }
};

std::string reason(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

template <typename T>
T* check_allocation(T* pointer) {
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

}  // namespace

struct MovieReader::State {
  std::filesystem::path file;
  std::unique_ptr<AVFormatContext, FormatCloser> format;
  std::unique_ptr<AVCodecContext, CodecCloser> codec;  // null for Motion JPEG
  std::unique_ptr<AVPacket, PacketFreer> packet{check_allocation(av_packet_alloc())};
  std::unique_ptr<AVFrame, FrameFreer> picture{check_allocation(av_frame_alloc())};
  std::unique_ptr<SwsContext, ScalerFreer> scaler;
  int stream = -1;
  int frames = 0;  // handed out so far
  bool draining = false;

  Error damaged(const std::string& why) const {
    return Error::bad_input(fmt::format("frame {} of the movie is damaged: {}", frames, why),
                            file.string(), "Repair the movie, or cut it and its times");
  }
  void open();
  void open_decoder(const AVCodecParameters& parameters);
  bool read_packet();
  bool decode();
  void convert(RgbImage& image);
};

void MovieReader::State::open() {
  const auto refuse = [&](std::string what, std::string advice) {
    return Error::bad_input(std::move(what), file.string(), std::move(advice));
  };
  AVFormatContext* context = nullptr;
  AVDictionary* options = nullptr;
  // A play list must not make us fetch anything from elsewhere.
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  const int opened =
      avformat_open_input(&context, ("file:" + file.string()).c_str(), nullptr, &options);
  av_dict_free(&options);
  if (opened < 0) {
    throw refuse("the movie cannot be read: " + reason(opened),
                 "Check that the file exists and is a movie");
  }
  format.reset(context);
  if (const int code = avformat_find_stream_info(context, nullptr); code < 0) {
    throw refuse("the movie is damaged: " + reason(code), "Replace the file");
  }
  stream = av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (stream < 0) throw refuse("there is no video in this file", "Check that it is the right file");
  for (unsigned i = 0; i < context->nb_streams; ++i) {
    if (static_cast<int>(i) != stream) context->streams[i]->discard = AVDISCARD_ALL;
  }
  const AVCodecParameters& parameters = *context->streams[stream]->codecpar;
  if (parameters.codec_id != AV_CODEC_ID_MJPEG) open_decoder(parameters);
}

void MovieReader::State::open_decoder(const AVCodecParameters& parameters) {
  const AVCodec* decoder = avcodec_find_decoder(parameters.codec_id);
  if (decoder == nullptr) {
    throw Error::bad_input(fmt::format("there is no decoder for this movie's codec ({})",
                                       avcodec_get_name(parameters.codec_id)),
                           file.string(),
                           "Convert the movie to a codec that `ffmpeg -decoders` lists");
  }
  codec.reset(check_allocation(avcodec_alloc_context3(decoder)));
  codec->thread_count = 1;  // cameras are read in parallel already
  int code = avcodec_parameters_to_context(codec.get(), &parameters);
  if (code >= 0) code = avcodec_open2(codec.get(), decoder, nullptr);
  if (code < 0) {
    throw Error::bad_input("the movie's decoder does not start: " + reason(code), file.string(),
                           "Replace the file");
  }
}

/// The next packet of our stream; false at the end.
bool MovieReader::State::read_packet() {
  for (;;) {
    av_packet_unref(packet.get());
    const int code = av_read_frame(format.get(), packet.get());
    if (code == AVERROR_EOF) return false;
    if (code < 0) throw damaged(reason(code));
    if (packet->stream_index != stream || packet->size == 0) continue;
    if ((packet->flags & AV_PKT_FLAG_CORRUPT) != 0) throw damaged("its bytes are incomplete");
    return true;
  }
}

/// Decodes one picture; false at the end.
bool MovieReader::State::decode() {
  for (;;) {
    const int code = avcodec_receive_frame(codec.get(), picture.get());
    if (code == AVERROR_EOF) return false;
    if (code == 0) {
      if (picture->decode_error_flags != 0 || (picture->flags & AV_FRAME_FLAG_CORRUPT) != 0) {
        throw damaged("it cannot be decoded whole");
      }
      return true;
    }
    if (code != AVERROR(EAGAIN)) throw damaged(reason(code));
    if (draining) throw damaged("the decoder does not end");
    draining = !read_packet();
    const int sent = avcodec_send_packet(codec.get(), draining ? nullptr : packet.get());
    if (sent < 0) throw damaged(reason(sent));
  }
}

void MovieReader::State::convert(RgbImage& image) {
  const auto source = static_cast<AVPixelFormat>(picture->format);
  // sws_getCachedContext keeps or replaces what it is given.
  scaler.reset(sws_getCachedContext(
      scaler.release(), picture->width, picture->height, source, picture->width, picture->height,
      AV_PIX_FMT_RGB24,
      SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP | SWS_BITEXACT,
      nullptr, nullptr, nullptr));
  if (!scaler) throw damaged("its pixel format cannot be converted to RGB");
  const bool full_range = picture->color_range == AVCOL_RANGE_JPEG ||
                          source == AV_PIX_FMT_YUVJ420P || source == AV_PIX_FMT_YUVJ422P ||
                          source == AV_PIX_FMT_YUVJ444P || source == AV_PIX_FMT_YUVJ440P;
  const int matrix =
      picture->colorspace == AVCOL_SPC_UNSPECIFIED || picture->colorspace == AVCOL_SPC_RGB
          ? SWS_CS_DEFAULT
          : static_cast<int>(picture->colorspace);
  constexpr int kUnchanged = 1 << 16;  // contrast and saturation, 16.16 fixed point
  // It refuses for RGB sources only, which have neither matrix nor range.
  sws_setColorspaceDetails(scaler.get(), sws_getCoefficients(matrix), full_range ? 1 : 0,
                           sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, kUnchanged, kUnchanged);
  image.width = picture->width;
  image.height = picture->height;
  image.pixels.resize(static_cast<std::size_t>(image.width) *
                      static_cast<std::size_t>(image.height) * 3);
  const std::array<std::uint8_t*, 4> planes{image.pixels.data(), nullptr, nullptr, nullptr};
  const std::array<int, 4> strides{image.width * 3, 0, 0, 0};
  const int rows = sws_scale(scaler.get(), picture->data, picture->linesize, 0, picture->height,
                             planes.data(), strides.data());
  if (rows != picture->height) throw damaged("it cannot be converted to RGB");
}

MovieReader::MovieReader(std::filesystem::path file) : state_(std::make_unique<State>()) {
  av_log_set_level(AV_LOG_QUIET);  // what is wrong with a file is said once, by our Error
  state_->file = std::move(file);
  state_->open();
}

MovieReader::~MovieReader() = default;

bool MovieReader::next(MovieFrame& frame) {
  State& state = *state_;
  frame.jpeg.clear();
  if (state.codec) {
    if (!state.decode()) return false;
    state.convert(frame.image);
  } else {
    if (!state.read_packet()) return false;
    const auto* bytes = reinterpret_cast<const std::byte*>(state.packet->data);
    frame.jpeg.assign(bytes, bytes + state.packet->size);
  }
  ++state.frames;
  return true;
}

int MovieReader::skip_rest() {
  const int before = state_->frames;
  while (state_->codec ? state_->decode() : state_->read_packet()) ++state_->frames;
  return state_->frames - before;
}

}  // namespace raystage
