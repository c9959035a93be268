// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/ffmpeg_address.h"

#include <dlfcn.h>
#include <fmt/format.h>

extern "C" {
#include <libavdevice/version.h>
#include <libavutil/log.h>
}

#include <regex>
#include <system_error>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"

namespace raystage::ingest {
namespace {

/// Loads libavdevice until the process ends. Linking it would double the start time of a process,
/// because it depends on SDL, OpenGL and 80 more libraries.
void load_devices() {
  const std::string name = fmt::format("libavdevice.so.{}", LIBAVDEVICE_VERSION_MAJOR);
  void* library = dlopen(name.c_str(), RTLD_NOW | RTLD_GLOBAL);
  void* register_all = library == nullptr ? nullptr : dlsym(library, "avdevice_register_all");
  if (register_all == nullptr) {
    throw Error::failed("FFmpeg's device library cannot be loaded", name,
                        "Install the package libavdevice59");
  }
  reinterpret_cast<void (*)()>(register_all)();
}

const AVInputFormat* find_format(const std::string& name) {
  if (const AVInputFormat* format = av_find_input_format(name.c_str()); format != nullptr) {
    return format;
  }
  load_devices();
  return av_find_input_format(name.c_str());
}

bool is_named_pipe(const std::filesystem::path& file) {
  std::error_code ignored;
  return std::filesystem::is_fifo(file, ignored);
}

bool is_device(const AVInputFormat* format) {
  if (format == nullptr || format->priv_class == nullptr) return false;
  const AVClassCategory category = format->priv_class->category;
  return category == AV_CLASS_CATEGORY_DEVICE_INPUT ||
         category == AV_CLASS_CATEGORY_DEVICE_VIDEO_INPUT;
}

/// Returns whether a lavfi filter graph runs in real time, like a camera. Does not examine a graph
/// in a separate file.
bool runs_in_real_time(const schemas::RecordConfig::FfmpegSource& source, const std::string& url) {
  static const std::regex filter(R"((^|[,;\]\s])a?realtime($|[=,;\[@\s]))");
  const auto given = source.options.find("graph");
  return std::regex_search(given == source.options.end() ? url : given->second, filter);
}

/// Splits "v4l2:/dev/video0" into format and URL, unless the part before the colon is a protocol, a
/// URL scheme or part of a file name.
void split_format(const std::filesystem::path& base, std::string& url, std::string& format) {
  const std::size_t colon = url.find(':');
  if (!format.empty() || colon == url.npos || colon == 0) return;
  if (url.compare(colon + 1, 2, "//") == 0 || avio_find_protocol_name(url.c_str()) != nullptr) {
    return;
  }
  std::error_code ignored;
  if (std::filesystem::exists(base / url, ignored)) return;
  format = url.substr(0, colon);
  url.erase(0, colon + 1);
}

}  // namespace

std::string without_credentials(const std::string& url) {
  const std::size_t host = url.find("//");
  if (host == url.npos) return url;
  const std::size_t end = url.find('/', host + 2);
  const std::size_t at = url.rfind('@', end);
  if (at == url.npos || at < host) return url;
  return url.substr(0, host + 2) + url.substr(at + 1);
}

FfmpegAddress resolve_ffmpeg_address(const schemas::RecordConfig::FfmpegSource& source,
                                     const std::filesystem::path& base) {
  FfmpegAddress address;
  address.url = source.url;
  address.may_redirect = source.options.contains("protocol_whitelist");
  std::string format = source.format;
  split_format(base, address.url, format);
  if (!format.empty()) {
    address.format = find_format(format);
    if (address.format == nullptr) {
      throw ConfigurationError(Error::bad_input(
          fmt::format("FFmpeg has no input format or protocol \"{}\"", format), source.url,
          "Choose one that `ffmpeg -demuxers` or `ffmpeg -devices` lists"));
    }
  }
  address.display_url = without_credentials(address.url);
  if (is_device(address.format)) {
    const bool graph = std::string_view(address.format->name) == "lavfi";
    address.kind = graph && !runs_in_real_time(source, address.url)
                       ? FfmpegAddress::Kind::kFilterGraph
                       : FfmpegAddress::Kind::kDevice;
    return address;
  }
  const char* name = avio_find_protocol_name(address.url.c_str());
  const std::string protocol = name == nullptr ? "" : name;
  if (protocol == "pipe") {
    address.kind = FfmpegAddress::Kind::kPipe;
  } else if (protocol == "file" ||
             (protocol.empty() && address.url.find("://") == address.url.npos)) {
    std::string path = address.url;
    if (path.starts_with("file:")) path.erase(0, 5);
    const std::filesystem::path file = base / path;
    address.display_url = file.string();
    address.url = "file:" + file.string();
    address.kind = is_named_pipe(file) ? FfmpegAddress::Kind::kPipe : FfmpegAddress::Kind::kFile;
  } else {
    address.kind = FfmpegAddress::Kind::kNetwork;
  }
  return address;
}

}  // namespace raystage::ingest
