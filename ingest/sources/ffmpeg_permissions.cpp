// SPDX-License-Identifier: Apache-2.0
// What the sources of a recording may open through FFmpeg. Lists of what is known to be harmless,
// not of what is known to be harmful: FFmpeg has hundreds of protocols, formats and filters.
#include "ingest/sources/ffmpeg_permissions.h"

#include <fmt/format.h>

extern "C" {
#include <libavutil/avstring.h>
#include <libavutil/mem.h>
}

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"

namespace raystage::ingest {
namespace {

constexpr std::string_view kProtocolOption = "protocol_whitelist";
constexpr std::string_view kFormatOption = "format_whitelist";

/// Containers and streams that hold their pictures themselves.
constexpr std::string_view kFormats =
    "matroska,webm,mov,mp4,avi,mpegts,mpeg,mjpeg,mpjpeg,yuv4mpegpipe,rawvideo,h264,hevc,av1,obu,"
    "ivf,"
    "flv,live_flv,nut,mxf,asf,dv,m4v,mpegvideo,vc1,ogg,gif,apng,v210,image2pipe,bmp_pipe,dpx_pipe,"
    "exr_pipe,j2k_pipe,jpeg_pipe,jpegls_pipe,pam_pipe,pgm_pipe,png_pipe,ppm_pipe,sgi_pipe,tiff_"
    "pipe,"
    "webp_pipe";

/// Formats that read the addresses which they contain.
constexpr std::array<std::string_view, 7> kFormatsOfReferences{
    "hls", "dash", "concat", "imf", "sdp", "applehttp", "webm_dash_manifest"};

/// Protocols of cameras, and what each opens.
constexpr std::array<std::pair<std::string_view, std::string_view>, 17> kNetworkProtocols{{
    {"http", "none"},  // HttpReader reads them, and FFmpeg opens nothing
    {"https", "none"},
    {"rtsp", "rtp,udp,tcp"},
    {"rtsps", "rtp,udp,tcp,tls"},
    {"rtp", "rtp,udp"},
    {"srtp", "srtp,rtp,udp"},
    {"udp", "udp"},
    {"udplite", "udplite"},
    {"tcp", "tcp"},
    {"tls", "tls,tcp"},
    {"unix", "unix"},
    {"srt", "srt"},
    {"rist", "rist"},
    {"rtmp", "rtmp,tcp"},
    {"rtmps", "rtmps,tls,tcp"},
    {"ftp", "ftp,tcp"},
    {"sftp", "sftp"},
}};

/// Filters that neither open files nor load libraries, whatever their options.
constexpr std::array<std::string_view, 80> kFilters{"allrgb",
                                                    "allyuv",
                                                    "anull",
                                                    "arealtime",
                                                    "avgblur",
                                                    "blackframe",
                                                    "blend",
                                                    "boxblur",
                                                    "bwdif",
                                                    "chromakey",
                                                    "color",
                                                    "colorbalance",
                                                    "colorchannelmixer",
                                                    "colorkey",
                                                    "colorlevels",
                                                    "colorspace",
                                                    "colorspectrum",
                                                    "colortemperature",
                                                    "convolution",
                                                    "copy",
                                                    "crop",
                                                    "drawbox",
                                                    "drawgrid",
                                                    "edgedetect",
                                                    "eq",
                                                    "exposure",
                                                    "fade",
                                                    "field",
                                                    "fillborders",
                                                    "format",
                                                    "fps",
                                                    "framerate",
                                                    "gblur",
                                                    "geq",
                                                    "gradients",
                                                    "haldclutsrc",
                                                    "hflip",
                                                    "hstack",
                                                    "hue",
                                                    "interlace",
                                                    "lenscorrection",
                                                    "limiter",
                                                    "loop",
                                                    "lut",
                                                    "lutrgb",
                                                    "lutyuv",
                                                    "mandelbrot",
                                                    "median",
                                                    "negate",
                                                    "noformat",
                                                    "noise",
                                                    "null",
                                                    "nullsrc",
                                                    "overlay",
                                                    "pad",
                                                    "pal75bars",
                                                    "pal100bars",
                                                    "perspective",
                                                    "pixelize",
                                                    "realtime",
                                                    "rgbtestsrc",
                                                    "rotate",
                                                    "scale",
                                                    "select",
                                                    "setdar",
                                                    "setparams",
                                                    "setpts",
                                                    "setsar",
                                                    "settb",
                                                    "smptebars",
                                                    "smptehdbars",
                                                    "split",
                                                    "testsrc",
                                                    "testsrc2",
                                                    "tpad",
                                                    "transpose",
                                                    "trim",
                                                    "unsharp",
                                                    "vflip",
                                                    "yadif"};

std::string_view scheme_of(const std::string& url) {
  const std::size_t colon = url.find(':');
  return colon == std::string::npos ? std::string_view() : std::string_view(url).substr(0, colon);
}

/// Returns a token in FFmpeg's quoting, and moves `text` behind it.
std::string token(const char*& text, const char* ends) {
  const std::unique_ptr<char, decltype(&av_free)> found(av_get_token(&text, ends), av_free);
  return found ? std::string(found.get()) : std::string();
}

std::string_view host_of(std::string_view url) {
  const std::size_t slashes = url.find("//");
  if (slashes == std::string_view::npos) return {};
  url = url.substr(slashes + 2);
  url = url.substr(0, url.find_first_of("/?#"));
  if (const std::size_t at = url.rfind('@'); at != std::string_view::npos) url = url.substr(at + 1);
  if (url.starts_with('[')) return url.substr(0, url.find(']'));
  return url.substr(0, url.find(':'));
}

ConfigurationError refused(const std::string& what, const FfmpegAddress& address,
                           std::string_view option) {
  return ConfigurationError(Error::bad_input(
      what, address.display_url,
      fmt::format("Give the address of one camera or file, or allow more by the option {} of the "
                  "source",
                  option)));
}

std::string protocols_of(const FfmpegAddress& address) {
  if (address.kind == FfmpegAddress::Kind::kFile) return "file";
  if (address.kind == FfmpegAddress::Kind::kPipe) return "pipe";
  const std::string_view scheme = scheme_of(address.url);
  const auto* known = std::ranges::find(kNetworkProtocols, scheme,
                                        &std::pair<std::string_view, std::string_view>::first);
  if (known != kNetworkProtocols.end()) return std::string(known->second);
  throw refused(
      fmt::format("the protocol \"{}\" is not one of cameras; it may read other addresses", scheme),
      address, kProtocolOption);
}

std::string formats_of(const FfmpegAddress& address) {
  std::string formats(kFormats);
  const std::string_view scheme = scheme_of(address.url);
  if (address.kind == FfmpegAddress::Kind::kFile) formats += ",image2";
  if (scheme.starts_with("rtsp")) formats += ",rtsp";
  if (scheme.ends_with("rtp")) formats += ",rtp";
  if (address.format == nullptr) return formats;
  const std::string_view name = address.format->name;
  if (std::ranges::find(kFormatsOfReferences, name) != kFormatsOfReferences.end()) {
    throw refused(fmt::format("the input format \"{}\" reads the addresses in its files", name),
                  address, kFormatOption);
  }
  return formats + "," + std::string(name);
}

}  // namespace

std::vector<std::string> filters_of_graph(const std::string& graph) {
  // As FFmpeg parses it (libavfilter/graphparser.c): labels in brackets, a filter with options
  // after
  // '=', labels; then ',' or ';'.
  constexpr const char* kSpace = " \n\t\r";
  std::vector<std::string> names;
  const char* text = graph.c_str();
  const auto skip_labels = [&] {
    for (;;) {
      text += std::string_view(text).find_first_not_of(kSpace) == std::string_view::npos
                  ? std::string_view(text).size()
                  : std::string_view(text).find_first_not_of(kSpace);
      if (*text != '[') return;
      ++text;
      token(text, "]");
      if (*text == ']') ++text;
    }
  };
  if (graph.starts_with("sws_flags=")) token(text, ";");
  if (*text == ';') ++text;
  for (;;) {
    skip_labels();
    if (*text == '\0') return names;
    const std::string name = token(text, "=,;[");
    names.push_back(name.substr(0, name.find('@')));  // NAME@INSTANCE
    if (*text == '=') token(++text, "[],;");
    skip_labels();
    if (*text != ',' && *text != ';') return names;
    ++text;
  }
}

void check_filters(const schemas::RecordConfig::FfmpegSource& source,
                   const FfmpegAddress& address) {
  if (address.format == nullptr || std::string_view(address.format->name) != "lavfi") return;
  const auto refuse = [&](const std::string& what) {
    return ConfigurationError(
        Error::bad_input(what, address.display_url,
                         "Use other filters, or allow filters with files if you trust the "
                         "configuration")
            .concerning({"allow-filters-with-files"}));
  };
  for (const char* option : {"graph_file", "dumpgraph"}) {
    if (source.options.contains(option)) {
      throw refuse(fmt::format("the option \"{}\" of the filter graph opens a file", option));
    }
  }
  const auto given = source.options.find("graph");
  for (const std::string& name :
       filters_of_graph(given == source.options.end() ? address.url : given->second)) {
    if (std::ranges::find(kFilters, name) != kFilters.end()) continue;
    throw refuse(fmt::format("the filter \"{}\" may open files", name));
  }
}

void limit_to_address(const schemas::RecordConfig::FfmpegSource& source,
                      const FfmpegAddress& address, FfmpegOptions& options) {
  using Kind = FfmpegAddress::Kind;
  if (address.kind == Kind::kDevice || address.kind == Kind::kFilterGraph) return;
  const auto limit = [&](std::string_view option, auto&& list) {
    const std::string name(option);
    if (!source.options.contains(name)) options.set(name, list());
  };
  limit(kProtocolOption, [&] { return protocols_of(address); });
  limit(kFormatOption, [&] { return formats_of(address); });
}

bool have_same_host(const std::string& url, const std::string& other) {
  const std::string_view a = host_of(url), b = host_of(other);
  return std::ranges::equal(a, b, [](char x, char y) { return av_tolower(x) == av_tolower(y); });
}

}  // namespace raystage::ingest
