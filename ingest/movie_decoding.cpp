// SPDX-License-Identifier: Apache-2.0
// Reads the frames of a movie through FFmpeg: Motion JPEG byte for byte, other codecs decoded in
// one thread and converted to RGB of 8 or 16 bits by swscale.
#include "ingest/movie_decoding.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"
#include "ingest/sources/ffmpeg_pointers.h"

namespace raystage::ingest {
namespace {

/// Returns the contrast, 16.16 fixed point, with which swscale converts Y'CbCr to R'G'B' of 16 bits
/// whose white is 65535. Without it white is that of 8 bits, 255, or the largest code, followed by
/// zeros: 0.4 % too dark in limited range.
int contrast_of_16_bits(AVPixelFormat source, bool full_range) {
  constexpr double kUnchanged = 1 << 16, kWhite = 65535, kLimitedWhite = 255 << 8;
  constexpr int kBits = 16;
  const int bits = std::min(kBits, av_pix_fmt_desc_get(source)->comp[0].depth);
  const double full_white = ((1 << bits) - 1) << (kBits - bits);
  return static_cast<int>(
      std::lround(kUnchanged * kWhite / (full_range ? full_white : kLimitedWhite)));
}

}  // namespace

struct MovieDecoder::State {
  std::filesystem::path file;
  AvPtr<AVFormatContext> format;
  AvPtr<AVCodecContext> codec;  // null for Motion JPEG
  AvPtr<AVPacket> packet{check_allocation(av_packet_alloc())};
  AvPtr<AVFrame> picture{check_allocation(av_frame_alloc())};
  AvPtr<SwsContext> scaler;
  int stream = -1;
  int frames = 0;  // delivered so far
  bool draining = false;

  Error damaged(const std::string& why) const {
    return Error::bad_input(fmt::format("frame {} of the movie is damaged: {}", frames, why),
                            file.string(), "Repair the movie, or cut it and its \"times_ns\"");
  }
  void open();
  void open_decoder(const AVCodecParameters& parameters);
  bool read_packet();
  bool decode();
  void convert(store::RgbImage& image);
  void convert(store::DeepPicture& picture);
  void convert(AVPixelFormat target, std::uint8_t* values, int row_bytes);
};

void MovieDecoder::State::open() {
  const auto refuse = [&](std::string what, std::string advice) {
    return Error::bad_input(std::move(what), file.string(), std::move(advice));
  };
  AVFormatContext* context = nullptr;
  FfmpegOptions options;
  // Prevents a playlist from opening network addresses.
  options.set("protocol_whitelist", "file");
  const int opened =
      avformat_open_input(&context, ("file:" + file.string()).c_str(), nullptr, options.get());
  if (opened < 0) {
    throw refuse("the movie cannot be read: " + av_error_text(opened),
                 "Check that the file exists and is a movie");
  }
  format.reset(context);
  if (const int code = avformat_find_stream_info(context, nullptr); code < 0) {
    throw refuse("the movie is damaged: " + av_error_text(code), "Replace the file");
  }
  stream = av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (stream < 0) throw refuse("the file has no video stream", "Choose a file with video");
  for (unsigned i = 0; i < context->nb_streams; ++i) {
    if (static_cast<int>(i) != stream) context->streams[i]->discard = AVDISCARD_ALL;
  }
  const AVCodecParameters& parameters = *context->streams[stream]->codecpar;
  if (parameters.codec_id != AV_CODEC_ID_MJPEG) open_decoder(parameters);
}

void MovieDecoder::State::open_decoder(const AVCodecParameters& parameters) {
  const AVCodec* decoder = avcodec_find_decoder(parameters.codec_id);
  if (decoder == nullptr) {
    throw Error::bad_input(fmt::format("FFmpeg has no decoder for the movie's codec {}",
                                       avcodec_get_name(parameters.codec_id)),
                           file.string(),
                           "Convert the movie to a codec that `ffmpeg -decoders` lists");
  }
  codec.reset(check_allocation(avcodec_alloc_context3(decoder)));
  codec->thread_count = 1;  // cameras are imported in parallel
  int code = avcodec_parameters_to_context(codec.get(), &parameters);
  if (code >= 0) code = avcodec_open2(codec.get(), decoder, nullptr);
  if (code < 0) {
    throw Error::bad_input("the movie's decoder does not start: " + av_error_text(code),
                           file.string(), "Replace the file");
  }
}

/// Reads the next packet of the stream; returns false at the end.
bool MovieDecoder::State::read_packet() {
  for (;;) {
    av_packet_unref(packet.get());
    const int code = av_read_frame(format.get(), packet.get());
    if (code == AVERROR_EOF) return false;
    if (code < 0) throw damaged(av_error_text(code));
    if (packet->stream_index != stream || packet->size == 0) continue;
    if ((packet->flags & AV_PKT_FLAG_CORRUPT) != 0) throw damaged("its bytes are incomplete");
    return true;
  }
}

/// Decodes one picture; returns false at the end.
bool MovieDecoder::State::decode() {
  for (;;) {
    const int code = avcodec_receive_frame(codec.get(), picture.get());
    if (code == AVERROR_EOF) return false;
    if (code == 0) {
      if (picture->decode_error_flags != 0 || (picture->flags & AV_FRAME_FLAG_CORRUPT) != 0) {
        throw damaged("it cannot be decoded completely");
      }
      return true;
    }
    if (code != AVERROR(EAGAIN)) throw damaged(av_error_text(code));
    if (draining) throw damaged("its decoder does not finish");
    draining = !read_packet();
    const int sent = avcodec_send_packet(codec.get(), draining ? nullptr : packet.get());
    if (sent < 0) throw damaged(av_error_text(sent));
  }
}

void MovieDecoder::State::convert(store::RgbImage& image) {
  image.width = picture->width;
  image.height = picture->height;
  image.values.resize(static_cast<std::size_t>(image.width) *
                      static_cast<std::size_t>(image.height) * 3);
  convert(AV_PIX_FMT_RGB24, image.values.data(), image.width * 3);
}

void MovieDecoder::State::convert(store::DeepPicture& deep) {
  constexpr int kPixelBytes = 3 * sizeof(std::uint16_t);
  deep.width = picture->width;
  deep.height = picture->height;
  deep.samples.resize(static_cast<std::size_t>(deep.width) * static_cast<std::size_t>(deep.height) *
                      3);
  convert(AV_PIX_FMT_RGB48, reinterpret_cast<std::uint8_t*>(deep.samples.data()),
          deep.width * kPixelBytes);
}

/// Converts the decoded picture to RGB.
void MovieDecoder::State::convert(AVPixelFormat target, std::uint8_t* values, int row_bytes) {
  const auto source = static_cast<AVPixelFormat>(picture->format);
  // sws_getCachedContext returns the given context or frees and replaces it.
  scaler.reset(sws_getCachedContext(
      scaler.release(), picture->width, picture->height, source, picture->width, picture->height,
      target,
      SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP | SWS_BITEXACT,
      nullptr, nullptr, nullptr));
  if (!scaler) throw damaged("its pixel format cannot be converted to RGB");
  // Grey has the range of RGB unless it states another, as in FFmpeg.
  const bool is_full_grey =
      av_pix_fmt_desc_get(source)->nb_components < 3 && picture->color_range != AVCOL_RANGE_MPEG;
  const bool full_range = picture->color_range == AVCOL_RANGE_JPEG || is_full_grey ||
                          source == AV_PIX_FMT_YUVJ420P || source == AV_PIX_FMT_YUVJ422P ||
                          source == AV_PIX_FMT_YUVJ444P || source == AV_PIX_FMT_YUVJ440P;
  const int matrix =
      picture->colorspace == AVCOL_SPC_UNSPECIFIED || picture->colorspace == AVCOL_SPC_RGB
          ? SWS_CS_DEFAULT
          : static_cast<int>(picture->colorspace);
  constexpr int kUnchanged = 1 << 16;  // saturation, 16.16 fixed point
  const int contrast =
      target == AV_PIX_FMT_RGB48 ? contrast_of_16_bits(source, full_range) : kUnchanged;
  // The call fails only for RGB sources, which have neither matrix nor range.
  sws_setColorspaceDetails(scaler.get(), sws_getCoefficients(matrix), full_range ? 1 : 0,
                           sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, contrast, kUnchanged);
  const std::array<std::uint8_t*, 4> planes{values, nullptr, nullptr, nullptr};
  const std::array<int, 4> strides{row_bytes, 0, 0, 0};
  const int rows = sws_scale(scaler.get(), picture->data, picture->linesize, 0, picture->height,
                             planes.data(), strides.data());
  if (rows != picture->height) throw damaged("it cannot be converted to RGB");
}

MovieDecoder::MovieDecoder(std::filesystem::path file) : state_(std::make_unique<State>()) {
  av_log_set_level(AV_LOG_QUIET);  // our Error reports failures once
  state_->file = std::move(file);
  state_->open();
}

MovieDecoder::~MovieDecoder() = default;

MovieFormat MovieDecoder::format() const {
  using Transfer = schemas::PixelEncoding::Transfer;
  AVFormatContext* context = state_->format.get();
  AVStream* const stream = context->streams[state_->stream];
  const AVRational rate = av_guess_frame_rate(context, stream, nullptr);
  MovieFormat format;
  format.frame_rate = rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 0;
  const AVCodecParameters& coded = *stream->codecpar;
  const AVPixFmtDescriptor* const pixels =
      av_pix_fmt_desc_get(static_cast<AVPixelFormat>(coded.format));
  if (state_->codec && pixels != nullptr) format.bits = pixels->comp[0].depth;
  if (coded.color_trc == AVCOL_TRC_SMPTE2084) format.transfer = Transfer::kPq;
  if (coded.color_trc == AVCOL_TRC_ARIB_STD_B67) format.transfer = Transfer::kHlg;
  if (coded.color_trc == AVCOL_TRC_LINEAR) format.transfer = Transfer::kLinear;
  format.has_bt2020_primaries = coded.color_primaries == AVCOL_PRI_BT2020;
  return format;
}

bool MovieDecoder::next(MovieFrame& frame, bool is_deep) {
  State& state = *state_;
  frame.jpeg.clear();
  if (state.codec) {
    if (!state.decode()) return false;
    if (is_deep) {
      state.convert(frame.deep);
    } else {
      state.convert(frame.image);
    }
  } else {
    if (!state.read_packet()) return false;
    const auto* bytes = reinterpret_cast<const std::byte*>(state.packet->data);
    frame.jpeg.assign(bytes, bytes + state.packet->size);
  }
  ++state.frames;
  return true;
}

}  // namespace raystage::ingest
