// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/http_options.h"

#include <fmt/format.h>

extern "C" {
#include <libavformat/version.h>
#include <libavutil/mem.h>
#include <libavutil/opt.h>
}

#include <array>
#include <cstddef>
#include <limits>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"

namespace raystage::ingest {
namespace {

using Fields = HttpOptions::Fields;
constexpr int kMaxRedirects = 8;  // as FFmpeg
constexpr double kMost = std::numeric_limits<int>::max();

AVOption option(const char* name, std::size_t offset, AVOptionType type, std::int64_t standard,
                double min, double max, const char* unit = nullptr) {
  AVOption made{};
  made.name = name;
  made.offset = static_cast<int>(offset);
  made.type = type;
  made.default_val.i64 = standard;
  made.min = min;
  made.max = max;
  made.flags = AV_OPT_FLAG_DECODING_PARAM;
  made.unit = unit;
  return made;
}

AVOption text_option(const char* name, std::size_t offset, const char* standard = nullptr) {
  AVOption made = option(name, offset, AV_OPT_TYPE_STRING, 0, 0, 0);
  made.default_val.str = standard;
  return made;
}

/// Returns FFmpeg's description of Fields.
const AVClass& fields_class() {
  // Cameras answer as they answered to FFmpeg.
  static constexpr const char* kUserAgent = "Lavf/" AV_STRINGIFY(LIBAVFORMAT_VERSION);
  static const std::array<AVOption, 21> options{
      text_option("user_agent", offsetof(Fields, user_agent), kUserAgent),
      text_option("headers", offsetof(Fields, headers)),
      text_option("referer", offsetof(Fields, referer)),
      text_option("cookies", offsetof(Fields, cookies)),
      text_option("http_proxy", offsetof(Fields, http_proxy)),
      text_option("ca_file", offsetof(Fields, ca_file)),
      text_option("cafile", offsetof(Fields, ca_file)),
      text_option("cert_file", offsetof(Fields, cert_file)),
      text_option("key_file", offsetof(Fields, key_file)),
      text_option("mime_type", offsetof(Fields, mime_type)),
      text_option("location", offsetof(Fields, location)),
      option("timeout", offsetof(Fields, timeout), AV_OPT_TYPE_INT64, 0, -1, kMost),
      option("rw_timeout", offsetof(Fields, rw_timeout), AV_OPT_TYPE_INT64, 0, 0, 9e18),
      option("tls_verify", offsetof(Fields, tls_verify), AV_OPT_TYPE_INT, 0, 0, 1),
      option("seekable", offsetof(Fields, seekable), AV_OPT_TYPE_BOOL, -1, -1, 1),
      option("max_redirects", offsetof(Fields, max_redirects), AV_OPT_TYPE_INT, kMaxRedirects, 0,
             kMaxRedirects),
      option("auth_type", offsetof(Fields, basic_at_once), AV_OPT_TYPE_INT, 0, 0, 1, "auth_type"),
      option("none", 0, AV_OPT_TYPE_CONST, 0, 0, 0, "auth_type"),
      option("basic", 0, AV_OPT_TYPE_CONST, 1, 0, 0, "auth_type"),
      option("recv_buffer_size", offsetof(Fields, receive_buffer_size), AV_OPT_TYPE_INT, -1, -1,
             kMost),
      AVOption{}};
  static const AVClass described = [] {
    AVClass made{};
    made.class_name = "raystage http";
    made.item_name = av_default_item_name;
    made.option = options.data();
    made.version = LIBAVUTIL_VERSION_INT;
    return made;
  }();
  return described;
}

bool is_option_of_ffmpegs_protocol(const char* name) {
  for (const char* protocol : {"http", "tls", "tcp"}) {
    const AVClass* known = avio_protocol_get_class(protocol);
    if (known != nullptr &&
        av_opt_find(&known, name, nullptr, 0, AV_OPT_SEARCH_FAKE_OBJ) != nullptr) {
      return true;
    }
  }
  return false;
}

}  // namespace

HttpOptions::HttpOptions(FfmpegOptions& options, const std::string& where) {
  fields_.av_class = &fields_class();
  av_opt_set_defaults(&fields_);
  try {
    const AVDictionaryEntry* entry = nullptr;
    while ((entry = av_dict_get(*options.get(), "", entry, AV_DICT_IGNORE_SUFFIX)) != nullptr) {
      const std::string name = entry->key;
      const bool known = name != "mime_type" && name != "location" &&
                         av_opt_find(&fields_, name.c_str(), nullptr, 0, 0) != nullptr;
      if (known) {
        const int code = av_opt_set(&fields_, name.c_str(), entry->value, 0);
        if (code >= 0) continue;
        throw ConfigurationError(Error::bad_input(
            fmt::format("the option \"{}\" has an impossible value: {}", name, entry->value), where,
            "Correct it; `ffmpeg -h protocol=http` lists the options"));
      }
      if (is_option_of_ffmpegs_protocol(name.c_str())) {
        throw ConfigurationError(Error::bad_input(
            fmt::format("the option \"{}\" of http is not supported", name), where,
            "Remove it. To open a lost camera again, set when_lost of the configuration to "
            "\"reconnect\""));
      }
    }
    for (const AVOption* known = fields_.av_class->option; known->name != nullptr; ++known) {
      if (known->type != AV_OPT_TYPE_CONST) av_dict_set(options.get(), known->name, nullptr, 0);
    }
  } catch (...) {
    av_opt_free(&fields_);
    throw;
  }
}

HttpOptions::~HttpOptions() { av_opt_free(&fields_); }

void HttpOptions::set_answer(const std::string& mime_type, const std::string& location) {
  const auto replace = [](char*& text, const std::string& by) {
    av_freep(&text);
    if (!by.empty()) text = check_allocation(av_strdup(by.c_str()));
  };
  replace(fields_.mime_type, mime_type);
  replace(fields_.location, location);
}

}  // namespace raystage::ingest
