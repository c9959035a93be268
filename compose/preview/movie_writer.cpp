// SPDX-License-Identifier: Apache-2.0
// Encodes pictures by libavcodec: conversion to 4:2:0, Rec.709 matrix, limited range (libswscale);
// then H.264 at CRF 18, or MPEG-4 part 2 at quantiser 3. Flags for bit-exact output are set. Input:
// sRGB codes, R, G, B of 8 bits. Cost: linear in pixels.
#include "compose/preview/movie_writer.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libavutil/spherical.h>
#include <libavutil/stereo3d.h>
#include <libswscale/swscale.h>
}

#include <array>
#include <cassert>
#include <string_view>

#include "base/atomic_file.h"
#include "base/error.h"

namespace raystage::compose {
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

std::string text_of(int error) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(error, text.data(), text.size());
  return text.data();
}

}  // namespace

struct MovieWriter::State {
  State(const std::filesystem::path& target, const Options& wanted)
      : file(target), settings(wanted), temporary(target) {}

  std::filesystem::path file;
  Options settings;
  TemporaryFile temporary;  // declared before the format, which is closed first
  std::unique_ptr<AVFormatContext, FreeFormat> format;
  std::unique_ptr<AVCodecContext, FreeByAddress<avcodec_free_context>> codec;
  std::unique_ptr<AVFrame, FreeByAddress<av_frame_free>> frame;
  std::unique_ptr<AVPacket, FreeByAddress<av_packet_free>> packet;
  std::unique_ptr<SwsContext, FreeScaler> scaler;
  std::vector<std::uint8_t> padded;  // picture of even size
  AVStream* stream = nullptr;        // owned by the format
  std::int64_t frames = 0;

  int even_width() const { return settings.width + settings.width % 2; }
  int even_height() const { return settings.height + settings.height % 2; }

  void check(int result, const char* doing) const {
    if (result >= 0) return;
    throw Error::failed(
        std::string("the movie cannot be written: ") + doing + ": " + text_of(result),
        file.string(), "Check the folder and the free disk space");
  }

  void open_encoder() {
    const AVCodec* encoder = avcodec_find_encoder_by_name("libx264");
    const bool h264 = encoder != nullptr;
    if (!h264) encoder = avcodec_find_encoder(AV_CODEC_ID_MPEG4);
    if (encoder == nullptr) {
      throw Error::failed("libavcodec has neither libx264 nor mpeg4", file.string(),
                          "Install a libavcodec with one of them");
    }
    codec.reset(avcodec_alloc_context3(encoder));
    if (!codec) throw std::bad_alloc();
    codec->width = even_width();
    codec->height = even_height();
    codec->pix_fmt = AV_PIX_FMT_YUV420P;
    codec->framerate = {settings.fps_numerator, settings.fps_denominator};
    codec->time_base = av_inv_q(codec->framerate);
    codec->color_range = AVCOL_RANGE_MPEG;
    codec->color_primaries = AVCOL_PRI_BT709;
    codec->color_trc = AVCOL_TRC_BT709;  // as players assume for display-referred video
    codec->colorspace = AVCOL_SPC_BT709;
    codec->flags |= AV_CODEC_FLAG_BITEXACT;
    if ((format->oformat->flags & AVFMT_GLOBALHEADER) != 0) {
      codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    }
    if (h264) {
      check(av_opt_set(codec->priv_data, "crf", "18", 0), "setting the quality");
      check(av_opt_set(codec->priv_data, "preset", "medium", 0), "setting the preset");
    } else {
      codec->flags |= AV_CODEC_FLAG_QSCALE;
      codec->global_quality = 3 * FF_QP2LAMBDA;
    }
    check(avcodec_open2(codec.get(), encoder, nullptr), "opening the encoder");
  }

  /// Says that the pictures are spherical or of two eyes. MP4: boxes sv3d and st3d of Spherical
  /// Video V2; Matroska: Projection and StereoMode.
  void add_projection() {
    if (settings.is_equirectangular) {
      std::size_t size = 0;
      AVSphericalMapping* mapping = av_spherical_alloc(&size);
      if (mapping == nullptr) throw std::bad_alloc();
      mapping->projection = AV_SPHERICAL_EQUIRECTANGULAR;
      add_side_data(AV_PKT_DATA_SPHERICAL, mapping, size);
    }
    if (settings.stereo == StereoPacking::kNone) return;
    AVStereo3D* packing = av_stereo3d_alloc();
    if (packing == nullptr) throw std::bad_alloc();
    packing->type = settings.stereo == StereoPacking::kTopBottom ? AV_STEREO3D_TOPBOTTOM
                                                                 : AV_STEREO3D_SIDEBYSIDE;
    add_side_data(AV_PKT_DATA_STEREO3D, packing, sizeof(AVStereo3D));
  }

  /// Takes over `data`, which libavutil allocated.
  void add_side_data(AVPacketSideDataType type, void* data, std::size_t size) const {
    const int result =
        av_stream_add_side_data(stream, type, static_cast<std::uint8_t*>(data), size);
    if (result < 0) av_free(data);
    check(result, "describing the stream");
  }

  void open() {
    // By the final name: the temporary one may have another extension.
    const AVOutputFormat* container = av_guess_format(nullptr, file.c_str(), nullptr);
    if (container == nullptr || container->video_codec == AV_CODEC_ID_NONE) {
      throw Error::bad_input("the extension of the movie is unknown", file.string(),
                             "Use .mp4, .mov or .mkv");
    }
    AVFormatContext* context = nullptr;
    check(avformat_alloc_output_context2(&context, container, nullptr, temporary.path().c_str()),
          "opening the container");
    format.reset(context);
    format->flags |= AVFMT_FLAG_BITEXACT;
    // libavformat counts the boxes of spherical and stereo video as unofficial.
    format->strict_std_compliance = FF_COMPLIANCE_UNOFFICIAL;
    if (settings.stereo != StereoPacking::kNone && std::string_view(container->name) == "mov") {
      throw Error::bad_input("a .mov file cannot say that its pictures are stereo", file.string(),
                             "Use .mp4 or .mkv");
    }
    open_encoder();
    stream = avformat_new_stream(format.get(), nullptr);
    if (stream == nullptr) throw std::bad_alloc();
    stream->time_base = codec->time_base;
    stream->avg_frame_rate = codec->framerate;
    check(avcodec_parameters_from_context(stream->codecpar, codec.get()), "describing the stream");
    add_projection();
    check(avio_open(&format->pb, temporary.path().c_str(), AVIO_FLAG_WRITE), "creating the file");
    AVDictionary* muxer = nullptr;
    av_dict_set(&muxer, "movflags", "+faststart+write_colr", 0);  // plays while it downloads
    const int result = avformat_write_header(format.get(), &muxer);
    av_dict_free(&muxer);
    check(result, "writing the header");

    frame.reset(av_frame_alloc());
    packet.reset(av_packet_alloc());
    if (!frame || !packet) throw std::bad_alloc();
    frame->format = codec->pix_fmt;
    frame->width = codec->width;
    frame->height = codec->height;
    frame->color_range = codec->color_range;
    frame->color_primaries = codec->color_primaries;
    frame->color_trc = codec->color_trc;
    frame->colorspace = codec->colorspace;
    check(av_frame_get_buffer(frame.get(), 0), "allocating a picture");

    scaler.reset(sws_getContext(codec->width, codec->height, AV_PIX_FMT_RGB24, codec->width,
                                codec->height, AV_PIX_FMT_YUV420P,
                                SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP, nullptr,
                                nullptr, nullptr));
    if (!scaler) throw std::bad_alloc();
    // RGB full range to limited range; the default matrix is that of standard definition.
    const int* rec709 = sws_getCoefficients(SWS_CS_ITU709);
    check(sws_setColorspaceDetails(scaler.get(), rec709, 1, rec709, 0, 0, 1 << 16, 1 << 16),
          "choosing the colour matrix");
  }

  const std::uint8_t* even_sized(const store::RgbImage& picture) {
    const int width = picture.width, height = picture.height;
    if (width == even_width() && height == even_height()) return picture.values.data();
    padded.clear();
    for (int y = 0; y < even_height(); ++y) {
      const std::uint8_t* row =
          picture.values.data() +
          static_cast<std::size_t>(std::min(y, height - 1)) * static_cast<std::size_t>(width) * 3;
      padded.insert(padded.end(), row, row + width * 3);
      if (even_width() > width) padded.insert(padded.end(), row + (width - 1) * 3, row + width * 3);
    }
    return padded.data();
  }

  void encode(const AVFrame* picture) {
    check(avcodec_send_frame(codec.get(), picture), "encoding");
    while (true) {
      const int result = avcodec_receive_packet(codec.get(), packet.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
      check(result, "encoding");
      packet->duration = 1;
      av_packet_rescale_ts(packet.get(), codec->time_base, stream->time_base);
      packet->stream_index = stream->index;
      check(av_interleaved_write_frame(format.get(), packet.get()), "writing");
    }
  }
};

MovieWriter::MovieWriter(const std::filesystem::path& file, const Options& settings)
    : state_(std::make_unique<State>(file, settings)) {
  av_log_set_level(AV_LOG_ERROR);  // otherwise libx264 prints statistics
  state_->open();
}

MovieWriter::~MovieWriter() = default;

void MovieWriter::append(const store::RgbImage& picture) {
  State& s = *state_;
  assert(picture.width == s.settings.width && picture.height == s.settings.height);
  s.check(av_frame_make_writable(s.frame.get()), "allocating a picture");
  const std::uint8_t* const source[] = {s.even_sized(picture)};
  const int stride[] = {s.codec->width * 3};
  sws_scale(s.scaler.get(), source, stride, 0, s.codec->height, s.frame->data, s.frame->linesize);
  s.frame->pts = s.frames++;
  s.encode(s.frame.get());
}

void MovieWriter::close() {
  State& s = *state_;
  s.encode(nullptr);
  s.check(av_write_trailer(s.format.get()), "finishing");
  s.check(avio_closep(&s.format->pb), "closing");
  s.temporary.commit();
}

std::string MovieWriter::encoder() const { return state_->codec->codec->name; }

}  // namespace raystage::compose
