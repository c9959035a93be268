// SPDX-License-Identifier: Apache-2.0
#include "testing/ingest/test_movie.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include <cstddef>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace raystage::testing {
namespace {

struct Freer {
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVFormatContext* context) const {
    if (context->pb != nullptr) avio_closep(&context->pb);
    avformat_free_context(context);
  }
};

int check(int code) {
  if (code < 0) throw std::runtime_error("FFmpeg cannot write the test movie");
  return code;
}

}  // namespace

void write_movie(const std::filesystem::path& file, const MovieDescription& movie) {
  const AVCodec* encoder = avcodec_find_encoder(AV_CODEC_ID_FFV1);
  if (encoder == nullptr) throw std::runtime_error("FFmpeg has no FFV1");
  const std::unique_ptr<AVCodecContext, Freer> codec(avcodec_alloc_context3(encoder));
  codec->width = movie.width;
  codec->height = movie.height;
  codec->pix_fmt = AV_PIX_FMT_YUV444P;
  codec->time_base = {1, 25};
  codec->colorspace = movie.matrix;
  codec->color_range = movie.range;
  check(avcodec_open2(codec.get(), encoder, nullptr));

  AVFormatContext* context = nullptr;
  const char* muxer = file.extension() == ".mov" ? "mov" : "matroska";
  check(avformat_alloc_output_context2(&context, nullptr, muxer, file.c_str()));
  const std::unique_ptr<AVFormatContext, Freer> format(context);
  AVStream* stream = avformat_new_stream(context, nullptr);
  stream->time_base = codec->time_base;
  check(avcodec_parameters_from_context(stream->codecpar, codec.get()));
  check(avio_open(&context->pb, file.c_str(), AVIO_FLAG_WRITE));
  check(avformat_write_header(context, nullptr));

  const std::unique_ptr<AVFrame, Freer> frame(av_frame_alloc());
  frame->format = codec->pix_fmt;
  frame->width = movie.width;
  frame->height = movie.height;
  frame->colorspace = movie.matrix;
  frame->color_range = movie.range;
  check(av_frame_get_buffer(frame.get(), 0));
  const std::unique_ptr<AVPacket, Freer> packet(av_packet_alloc());
  for (int i = 0; i <= movie.frames; ++i) {
    const bool more = i < movie.frames;
    if (more) {
      check(av_frame_make_writable(frame.get()));
      for (std::size_t plane = 0; plane < 3; ++plane) {
        std::memset(frame->data[plane], movie.yuv[plane],
                    static_cast<std::size_t>(frame->linesize[plane]) *
                        static_cast<std::size_t>(movie.height));
      }
      frame->pts = i;
    }
    check(avcodec_send_frame(codec.get(), more ? frame.get() : nullptr));
    while (avcodec_receive_packet(codec.get(), packet.get()) == 0) {
      av_packet_rescale_ts(packet.get(), codec->time_base, stream->time_base);
      packet->stream_index = stream->index;
      check(av_interleaved_write_frame(context, packet.get()));
    }
  }
  check(av_write_trailer(context));
}

}  // namespace raystage::testing
