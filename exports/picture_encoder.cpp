// SPDX-License-Identifier: Apache-2.0
// Encodes pictures by libavcodec and writes QuickTime movies by libavformat. ProRes: prores_ks,
// profile HQ, after conversion by libswscale. FFV1: version 3, GOP of 1, slice CRCs, pixels as G,
// B, R, so that decoded codes are the codes of the picture. Cost: linear in pixels.
#include "exports/picture_encoder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "base/atomic_file.h"
#include "base/error.h"

namespace raystage::exports {
namespace {

template <auto free_function>
struct FreeByAddress {
  template <class T>
  void operator()(T* object) const {
    free_function(&object);
  }
};
struct FreeFormat {
  void operator()(AVFormatContext* format) const {
    if (format->pb != nullptr) avio_closep(&format->pb);
    avformat_free_context(format);
  }
};
struct FreeScaler {
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};
using CodecContext = std::unique_ptr<AVCodecContext, FreeByAddress<avcodec_free_context>>;
using Frame = std::unique_ptr<AVFrame, FreeByAddress<av_frame_free>>;
using Packet = std::unique_ptr<AVPacket, FreeByAddress<av_packet_free>>;

std::string text_of(int error) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(error, text.data(), text.size());
  return text.data();
}

void check(int result, const char* doing, const std::string& file) {
  if (result >= 0) return;
  throw Error::failed(std::string("the movie cannot be written: ") + doing + ": " + text_of(result),
                      file, "Check the folder and the free disk space");
}

void silence_libav() {
  static std::once_flag once;
  std::call_once(once, [] { av_log_set_level(AV_LOG_ERROR); });
}

/// What an IntraCodec is in libavcodec.
struct EncoderSettings {
  const char* name;
  AVPixelFormat format;
  const char* options;  ///< as av_set_options_string() takes them
  bool is_limited_range;
};

EncoderSettings settings_of(IntraCodec codec) {
  switch (codec) {
    case IntraCodec::kProRes:
      return {"prores_ks", AV_PIX_FMT_YUV422P10, "profile=hq:vendor=apl0", true};
    case IntraCodec::kFfv1:
      break;
  }
  return {"ffv1", AV_PIX_FMT_0RGB32, "slicecrc=1", false};
}

}  // namespace

struct PictureEncoder::State {
  std::string file;
  CodecContext codec;
  Frame frame;
  Packet packet;
  std::unique_ptr<SwsContext, FreeScaler> scaler;  ///< null: pixels are copied
  std::int64_t pictures = 0;

  void open(IntraCodec kind, int width, int height) {
    const EncoderSettings settings = settings_of(kind);
    const AVCodec* encoder = avcodec_find_encoder_by_name(settings.name);
    if (encoder == nullptr) {
      throw Error::failed(std::string("libavcodec has no encoder ") + settings.name, file,
                          "Install a libavcodec with it");
    }
    codec.reset(avcodec_alloc_context3(encoder));
    if (!codec) throw std::bad_alloc();
    codec->width = width;
    codec->height = height;
    codec->pix_fmt = settings.format;
    codec->time_base = {1, 1000000};
    codec->flags |= AV_CODEC_FLAG_BITEXACT;
    codec->thread_count = 1;  // cameras are encoded in parallel
    codec->gop_size = 1;
    codec->color_primaries = AVCOL_PRI_BT709;
    if (settings.is_limited_range) {
      codec->color_range = AVCOL_RANGE_MPEG;
      codec->color_trc = AVCOL_TRC_BT709;  // as players assume for display-referred video
      codec->colorspace = AVCOL_SPC_BT709;
    } else {
      codec->level = 3;
      codec->color_range = AVCOL_RANGE_JPEG;
      codec->color_trc = AVCOL_TRC_IEC61966_2_1;
      codec->colorspace = AVCOL_SPC_RGB;
    }
    check(av_set_options_string(codec->priv_data, settings.options, "=", ":"),
          "setting the encoder's options", file);
    check(avcodec_open2(codec.get(), encoder, nullptr), "opening the encoder", file);
    frame.reset(av_frame_alloc());
    packet.reset(av_packet_alloc());
    if (!frame || !packet) throw std::bad_alloc();
    frame->format = codec->pix_fmt;
    frame->width = width;
    frame->height = height;
    frame->color_range = codec->color_range;
    frame->color_primaries = codec->color_primaries;
    frame->color_trc = codec->color_trc;
    frame->colorspace = codec->colorspace;
    check(av_frame_get_buffer(frame.get(), 0), "allocating a picture", file);
    if (!settings.is_limited_range) return;
    scaler.reset(sws_getContext(width, height, AV_PIX_FMT_RGB24, width, height, codec->pix_fmt,
                                SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP, nullptr,
                                nullptr, nullptr));
    if (!scaler) throw std::bad_alloc();
    // RGB full range to limited range; the default matrix is that of standard definition.
    const int* rec709 = sws_getCoefficients(SWS_CS_ITU709);
    check(sws_setColorspaceDetails(scaler.get(), rec709, 1, rec709, 0, 0, 1 << 16, 1 << 16),
          "choosing the colour matrix", file);
  }

  /// Copies R, G, B codes to pixels of 32 bits: X, R, G, B from the highest byte.
  void copy_pixels(const store::RgbImage& picture) {
    for (int y = 0; y < picture.height; ++y) {
      const auto row = picture.row(y);
      std::uint8_t* to = frame->data[0] + static_cast<std::ptrdiff_t>(y) * frame->linesize[0];
      for (int x = 0; x < picture.width; ++x) {
        const std::uint32_t pixel = static_cast<std::uint32_t>(row[3 * x]) << 16 |
                                    static_cast<std::uint32_t>(row[3 * x + 1]) << 8 |
                                    row[3 * x + 2];
        std::memcpy(to + std::ptrdiff_t{4} * x, &pixel, sizeof(pixel));
      }
    }
  }
};

PictureEncoder::PictureEncoder(IntraCodec codec, int width, int height, std::string name)
    : state_(std::make_unique<State>()) {
  silence_libav();
  state_->file = std::move(name);
  state_->open(codec, width, height);
}

PictureEncoder::~PictureEncoder() = default;

std::vector<std::byte> PictureEncoder::encode(const store::RgbImage& picture) {
  State& s = *state_;
  assert(picture.width == s.codec->width && picture.height == s.codec->height);
  check(av_frame_make_writable(s.frame.get()), "allocating a picture", s.file);
  if (s.scaler) {
    const std::uint8_t* const source[] = {picture.values.data()};
    const int stride[] = {picture.width * 3};
    sws_scale(s.scaler.get(), source, stride, 0, picture.height, s.frame->data, s.frame->linesize);
  } else {
    s.copy_pixels(picture);
  }
  s.frame->pts = s.pictures++;
  check(avcodec_send_frame(s.codec.get(), s.frame.get()), "encoding", s.file);
  check(avcodec_receive_packet(s.codec.get(), s.packet.get()), "encoding", s.file);
  const auto* bytes = reinterpret_cast<const std::byte*>(s.packet->data);
  std::vector<std::byte> result(bytes, bytes + s.packet->size);
  av_packet_unref(s.packet.get());
  return result;
}

std::vector<std::byte> PictureEncoder::extra_data() const {
  const auto* bytes = reinterpret_cast<const std::byte*>(state_->codec->extradata);
  if (bytes == nullptr) return {};
  return {bytes, bytes + state_->codec->extradata_size};
}

struct MovMuxer::State {
  explicit State(const std::filesystem::path& target) : file(target.string()), temporary(target) {}

  std::string file;
  TemporaryFile temporary;  // declared before the format, which is closed first
  std::unique_ptr<AVFormatContext, FreeFormat> format;
  Packet packet;
  AVStream* stream = nullptr;  // owned by the format
  AVRational unit{1, 1000000};
  std::int64_t typical_duration = 1, last_duration = 0;
  struct Pending {
    std::vector<std::byte> bytes;
    std::int64_t time = 0;
  };
  std::optional<Pending> pending;  ///< its duration is not known yet

  std::int64_t in_units(Nanoseconds time) const {
    return static_cast<std::int64_t>(
        std::llround(static_cast<long double>(time) * unit.den / (1e9L * unit.num)));
  }

  void write_pending(std::int64_t duration) {
    if (!pending) return;
    check(av_new_packet(packet.get(), static_cast<int>(pending->bytes.size())), "writing", file);
    std::memcpy(packet->data, pending->bytes.data(), pending->bytes.size());
    packet->pts = packet->dts = pending->time;
    packet->duration = duration;
    packet->flags |= AV_PKT_FLAG_KEY;
    packet->stream_index = stream->index;
    av_packet_rescale_ts(packet.get(), unit, stream->time_base);
    check(av_write_frame(format.get(), packet.get()), "writing", file);
    av_packet_unref(packet.get());
    last_duration = duration;
    pending.reset();
  }
};

MovMuxer::MovMuxer(const std::filesystem::path& file, const MovieDescription& description,
                   const PictureEncoder* encoder)
    : state_(std::make_unique<State>(file)) {
  silence_libav();
  State& s = *state_;
  if (description.rate) s.unit = {description.rate->denominator, description.rate->numerator};
  s.typical_duration = std::max<std::int64_t>(1, s.in_units(description.typical_duration));
  AVFormatContext* context = nullptr;
  check(avformat_alloc_output_context2(&context, nullptr, "mov", s.temporary.path().c_str()),
        "opening the container", s.file);
  s.format.reset(context);
  s.format->flags |= AVFMT_FLAG_BITEXACT;
  s.stream = avformat_new_stream(s.format.get(), nullptr);
  s.packet.reset(av_packet_alloc());
  if (s.stream == nullptr || !s.packet) throw std::bad_alloc();
  s.stream->time_base = s.unit;
  AVCodecParameters& parameters = *s.stream->codecpar;
  if (encoder != nullptr) {
    check(avcodec_parameters_from_context(&parameters, encoder->state_->codec.get()),
          "describing the stream", s.file);
  } else {
    parameters.codec_type = AVMEDIA_TYPE_VIDEO;
    parameters.codec_id = AV_CODEC_ID_MJPEG;
    parameters.width = description.width;
    parameters.height = description.height;
    parameters.color_range = AVCOL_RANGE_JPEG;
  }
  if (description.rate) {
    s.stream->avg_frame_rate = {description.rate->numerator, description.rate->denominator};
  }
  av_dict_set(&s.stream->metadata, "handler_name", description.name.c_str(), 0);
  check(avio_open(&s.format->pb, s.temporary.path().c_str(), AVIO_FLAG_WRITE), "creating the file",
        s.file);
  AVDictionary* muxer = nullptr;
  av_dict_set_int(&muxer, "video_track_timescale", s.unit.den, 0);
  av_dict_set_int(&muxer, "movie_timescale", s.unit.den, 0);  // of the empty edit
  av_dict_set(&muxer, "movflags", "+write_colr", 0);
  const int result = avformat_write_header(s.format.get(), &muxer);
  av_dict_free(&muxer);
  check(result, "writing the header", s.file);
}

MovMuxer::~MovMuxer() = default;

void MovMuxer::append(std::span<const std::byte> packet, Nanoseconds time) {
  State& s = *state_;
  std::int64_t at = s.in_units(time);
  if (s.pending) {
    // Frames closer than the unit, as after a clock that stood still, stay in order.
    at = std::max(at, s.pending->time + 1);
    // libavformat would silently move all later frames.
    if (at - s.pending->time >= std::numeric_limits<std::int32_t>::max()) {
      throw Error::bad_input("two frames are farther apart than a QuickTime movie can state",
                             s.file, "Export a Matroska file, or a part of the take");
    }
    s.write_pending(at - s.pending->time);
  }
  s.pending = State::Pending{{packet.begin(), packet.end()}, at};
}

void MovMuxer::close() {
  State& s = *state_;
  s.write_pending(s.last_duration > 0 ? s.last_duration : s.typical_duration);
  check(av_write_trailer(s.format.get()), "finishing", s.file);
  check(avio_closep(&s.format->pb), "closing", s.file);
  s.temporary.commit();
}

}  // namespace raystage::exports
