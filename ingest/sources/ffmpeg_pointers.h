// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/: owning pointers to FFmpeg's objects.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/dict.h>
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

#include <array>
#include <memory>
#include <new>
#include <string>

namespace raystage::ingest {

struct AvDeleter {
  void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
  void operator()(AVIOContext* connection) const { avio_close(connection); }
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(SwsContext* context) const { sws_freeContext(context); }
};
template <typename T>
using AvPtr = std::unique_ptr<T, AvDeleter>;

/// Owns a dictionary of FFmpeg options.
class FfmpegOptions {
 public:
  FfmpegOptions() = default;
  ~FfmpegOptions() { av_dict_free(&options_); }
  FfmpegOptions(const FfmpegOptions&) = delete;
  FfmpegOptions& operator=(const FfmpegOptions&) = delete;

  void set(const std::string& name, const std::string& value) {
    av_dict_set(&options_, name.c_str(), value.c_str(), 0);
  }
  void remove(const char* name) { av_dict_set(&options_, name, nullptr, 0); }
  /// Returns the value of an option, or an empty text.
  std::string value(const std::string& name) const {
    const AVDictionaryEntry* entry = av_dict_get(options_, name.c_str(), nullptr, 0);
    return entry == nullptr ? std::string() : std::string(entry->value);
  }
  /// Returns the quoted names of the unused options, separated by commas.
  std::string names() const {
    std::string list;
    const AVDictionaryEntry* entry = nullptr;
    while ((entry = av_dict_get(options_, "", entry, AV_DICT_IGNORE_SUFFIX)) != nullptr) {
      if (!list.empty()) list += ", ";
      list += '"' + std::string(entry->key) + '"';
    }
    return list;
  }
  AVDictionary** get() { return &options_; }

 private:
  AVDictionary* options_ = nullptr;
};

inline std::string av_error_text(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

template <typename T>
T* check_allocation(T* pointer) {
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

}  // namespace raystage::ingest
