// SPDX-License-Identifier: Apache-2.0
// Decodes a group of frames from its first, in one thread: HEVC by FFmpeg's own decoder, AV1 by
// dav1d. Cost: one decoding of a frame and one encoding as JPEG each.
#include "store/temporal/group_decoding.h"

#include <cstring>
#include <stdexcept>

#include "store/temporal/ffmpeg_codec.h"
#include "store/temporal/planes.h"

namespace raystage::store {
namespace {

class GroupPictures {
 public:
  GroupPictures(VideoCodec codec, int width, int height) : width_(width), height_(height) {
    av_log_set_level(AV_LOG_QUIET);  // errors are returned
    const AVCodec* const decoder =
        codec == VideoCodec::kHevc  ? avcodec_find_decoder(AV_CODEC_ID_HEVC)
        : codec == VideoCodec::kAv1 ? avcodec_find_decoder_by_name("libdav1d")
                                    : nullptr;
    if (decoder == nullptr) throw std::runtime_error("FFmpeg has no decoder for it");
    context_ = ffmpeg::owned(avcodec_alloc_context3(decoder));
    context_->thread_count = 1;
    constexpr std::int64_t kRowPadding = 256;  // counts as pixels
    context_->max_pixels = (coded_side(width) + kRowPadding) * coded_side(height);
    check(avcodec_open2(context_.get(), decoder, nullptr));
  }

  /// An empty frame: no more follow.
  void send(std::span<const std::byte> frame) {
    if (frame.empty()) {
      check(avcodec_send_packet(context_.get(), nullptr));
    } else {
      const auto packet = ffmpeg::owned(av_packet_alloc());
      check(av_new_packet(packet.get(), static_cast<int>(frame.size())));  // with padding
      std::memcpy(packet->data, frame.data(), frame.size());
      check(avcodec_send_packet(context_.get(), packet.get()));
    }
    receive();
  }

  std::vector<std::vector<std::byte>> jpegs;

 private:
  static void check(int code) {
    if (code < 0) throw std::runtime_error(ffmpeg::error_text(code));
  }

  void receive() {
    for (;;) {
      const int code = avcodec_receive_frame(context_.get(), picture_.get());
      if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return;
      check(code);
      if (picture_->decode_error_flags != 0 || (picture_->flags & AV_FRAME_FLAG_CORRUPT) != 0) {
        throw std::runtime_error("a frame cannot be decoded completely");
      }
      const bool is_444 =
          picture_->format == AV_PIX_FMT_YUV444P || picture_->format == AV_PIX_FMT_YUVJ444P;
      const bool is_420 =
          picture_->format == AV_PIX_FMT_YUV420P || picture_->format == AV_PIX_FMT_YUVJ420P;
      if ((!is_444 && !is_420) || picture_->width != coded_side(width_) ||
          picture_->height != coded_side(height_)) {
        throw std::runtime_error("a frame has another form or size than its camera's");
      }
      PlanesView planes;
      planes.chroma = is_444 ? ChromaStep::k444 : ChromaStep::k420;
      for (std::size_t c = 0; c < 3; ++c) {
        planes.plane[c] = picture_->data[c];
        planes.stride[c] = picture_->linesize[c];
      }
      jpegs.push_back(jpeg_of_planes(planes, width_, height_));
    }
  }

  int width_, height_;
  ffmpeg::Owned<AVCodecContext> context_;
  ffmpeg::Owned<AVFrame> picture_ = ffmpeg::owned(av_frame_alloc());
};

}  // namespace

std::vector<std::vector<std::byte>> decode_group(VideoCodec codec, int width, int height,
                                                 std::span<const std::vector<std::byte>> frames) {
  constexpr int kMaxSide = 1 << 14;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide || frames.empty() ||
      frames.size() > kMaxGroupFrames) {
    throw std::runtime_error("its size is not possible");
  }
  GroupPictures pictures(codec, width, height);
  for (const std::vector<std::byte>& frame : frames) {
    if (frame.empty() || frame.size() > (std::size_t{1} << 28)) {
      throw std::runtime_error("a frame is empty or too large");
    }
    pictures.send(frame);
  }
  pictures.send({});
  if (pictures.jpegs.size() != frames.size()) {
    throw std::runtime_error("it has fewer or more pictures than frames");
  }
  return std::move(pictures.jpegs);
}

}  // namespace raystage::store
