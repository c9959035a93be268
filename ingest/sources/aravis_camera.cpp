// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/aravis_camera.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "ingest/sources/configuration_error.h"
#include "ingest/sources/ffmpeg_pointers.h"

namespace raystage::ingest {
namespace {

std::string text_or_empty(const char* text) { return text == nullptr ? "" : text; }

/// Returns "A, B, C" and frees the list, which Aravis allocated.
std::string list_of(const char** names, guint count) {
  std::string list;
  for (guint i = 0; i < count; ++i) {
    if (i > 0) list += ", ";
    list += names[i];
  }
  g_free(names);
  return list;
}

std::string devices_found() {
  std::string list;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    if (i > 0) list += ", ";
    list += text_or_empty(arv_get_device_id(i));
  }
  return list.empty() ? "none" : list;
}

/// Returns the Aravis id of the device with this serial number, id or address; empty if none.
std::string find_device(const std::string& device) {
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    for (const char* name : {arv_get_device_serial_nbr(i), arv_get_device_id(i),
                             arv_get_device_address(i), arv_get_device_physical_id(i)}) {
      if (device == text_or_empty(name)) return text_or_empty(arv_get_device_id(i));
    }
  }
  return {};
}

/// Changes settings of a camera and reports those that it rejects.
class Settings {
 public:
  Settings(ArvCamera* camera, std::string where) : camera_(camera), where_(std::move(where)) {}

  template <typename Bounds, typename Set>
  void number(const char* name, double value, const Bounds& bounds, const Set& set) {
    double low = 0, high = 0;
    bounds(camera_, &low, &high, error_.clear_and_get());
    if (!error_ && !(value >= low && value <= high)) {
      throw ConfigurationError(Error::bad_input(
          fmt::format("{} is {}, the camera allows: {} to {}", name, value, low, high), where_,
          "Set a value within that range"));
    }
    set(camera_, value, error_.clear_and_get());
    check(name);
  }

  /// Throws if the previous Aravis call reported an error.
  void check(const char* name, const std::string& allowed = {}) {
    if (!error_) return;
    const Error error = Error::bad_input(
        fmt::format("the camera rejected {}: {}", name, error_.text()), where_,
        allowed.empty() ? "Remove it, or see the camera's manual" : "Choose one of: " + allowed);
    if (error_.is_refusal()) throw ConfigurationError(error);
    throw Error(error);
  }
  GErrorHolder& error() { return error_; }

 private:
  ArvCamera* camera_;
  std::string where_;
  GErrorHolder error_;
};

std::string pixel_formats_of(ArvCamera* camera) {
  guint count = 0;
  GErrorHolder error;
  const char** names =
      arv_camera_dup_available_pixel_formats_as_strings(camera, &count, error.clear_and_get());
  return list_of(names, count);
}

void set_pixel_format(ArvCamera* camera, const std::string& wanted, const std::string& where,
                      Settings& settings) {
  if (!wanted.empty()) {
    arv_camera_set_pixel_format_from_string(camera, wanted.c_str(),
                                            settings.error().clear_and_get());
    if (settings.error()) settings.check("pixel_format", pixel_formats_of(camera));
  }
  const ArvPixelFormat format =
      arv_camera_get_pixel_format(camera, settings.error().clear_and_get());
  settings.check("the request for its pixel_format");
  if (av_pixel_format(format) >= 0) return;
  throw ConfigurationError(Error::bad_input(
      fmt::format("the camera's pixel_format {} is not supported",
                  text_or_empty(arv_camera_get_pixel_format_as_string(camera, nullptr))),
      where,
      fmt::format("Set it to Mono8, Mono10, Mono12, Mono14, Mono16, RGB8, BGR8, YUV422_8 or an "
                  "8-bit Bayer format; the camera has: {}",
                  pixel_formats_of(camera))));
}

void set_trigger(ArvCamera* camera, const std::string& trigger, Settings& settings) {
  if (trigger.empty()) {
    // Cameras without triggers report an error, but are free-running anyway.
    arv_camera_clear_triggers(camera, settings.error().clear_and_get());
    return;
  }
  guint count = 0;
  GErrorHolder ignored;
  const char** names =
      arv_camera_dup_available_trigger_sources(camera, &count, ignored.clear_and_get());
  const std::string allowed = list_of(names, count);
  arv_camera_set_trigger(camera, trigger.c_str(), settings.error().clear_and_get());
  settings.check("trigger", allowed);
}

}  // namespace

GObjectPtr<ArvCamera> open_aravis_camera(const std::string& device) {
  GErrorHolder error;
  const char* name = device.empty() ? nullptr : device.c_str();
  // An id or address is found in milliseconds; the search below takes a second.
  GObjectPtr<ArvCamera> camera(arv_camera_new(name, error.clear_and_get()));
  if (camera) return camera;
  const std::string reason = error.text();
  arv_update_device_list();
  const std::string id = device.empty() ? "" : find_device(device);
  if (!id.empty()) camera.reset(arv_camera_new(id.c_str(), error.clear_and_get()));
  if (camera) return camera;
  throw Error::failed(
      fmt::format("the camera cannot be opened: {}; found: {}", error ? error.text() : reason,
                  devices_found()),
      device.empty() ? "aravis" : device,
      "Check its power, cable and network, and close other programs that control it");
}

void configure_aravis_camera(ArvCamera* camera, const schemas::RecordConfig::AravisSource& source) {
  const std::string where = text_or_empty(arv_camera_get_device_id(camera, nullptr));
  Settings settings(camera, where);
  set_pixel_format(camera, source.pixel_format, where, settings);
  if (source.exposure_us) {
    // The error of cameras without automatic exposure is ignored.
    arv_camera_set_exposure_time_auto(camera, ARV_AUTO_OFF, settings.error().clear_and_get());
    settings.number("exposure_us", *source.exposure_us, arv_camera_get_exposure_time_bounds,
                    arv_camera_set_exposure_time);
  }
  if (source.gain) {
    arv_camera_set_gain_auto(camera, ARV_AUTO_OFF, settings.error().clear_and_get());
    settings.number("gain", *source.gain, arv_camera_get_gain_bounds, arv_camera_set_gain);
  }
  if (source.fps) {
    settings.number("fps", *source.fps, arv_camera_get_frame_rate_bounds,
                    arv_camera_set_frame_rate);
  }
  set_trigger(camera, source.trigger, settings);
  arv_camera_set_acquisition_mode(camera, ARV_ACQUISITION_MODE_CONTINUOUS,
                                  settings.error().clear_and_get());
  if (arv_camera_is_gv_device(camera) == FALSE) return;
  if (source.packet_size) {
    arv_camera_gv_set_packet_size(camera, *source.packet_size, settings.error().clear_and_get());
    settings.check("packet_size");
    arv_camera_gv_set_packet_size_adjustment(camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  }
  if (!source.packet_socket) {
    arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  }
}

int av_pixel_format(ArvPixelFormat format) {
  struct Pair {
    ArvPixelFormat aravis;
    int ffmpeg;
  };
  constexpr Pair kFormats[] = {
      {ARV_PIXEL_FORMAT_MONO_8, AV_PIX_FMT_GRAY8},
      {ARV_PIXEL_FORMAT_MONO_10, AV_PIX_FMT_GRAY10LE},
      {ARV_PIXEL_FORMAT_MONO_12, AV_PIX_FMT_GRAY12LE},
      {ARV_PIXEL_FORMAT_MONO_14, AV_PIX_FMT_GRAY14LE},
      {ARV_PIXEL_FORMAT_MONO_16, AV_PIX_FMT_GRAY16LE},
      {ARV_PIXEL_FORMAT_RGB_8_PACKED, AV_PIX_FMT_RGB24},
      {ARV_PIXEL_FORMAT_BGR_8_PACKED, AV_PIX_FMT_BGR24},
      {ARV_PIXEL_FORMAT_BAYER_RG_8, AV_PIX_FMT_BAYER_RGGB8},
      {ARV_PIXEL_FORMAT_BAYER_BG_8, AV_PIX_FMT_BAYER_BGGR8},
      {ARV_PIXEL_FORMAT_BAYER_GR_8, AV_PIX_FMT_BAYER_GRBG8},
      {ARV_PIXEL_FORMAT_BAYER_GB_8, AV_PIX_FMT_BAYER_GBRG8},
      {ARV_PIXEL_FORMAT_YUV_422_PACKED, AV_PIX_FMT_UYVY422},
      {ARV_PIXEL_FORMAT_YUV_422_YUYV_PACKED, AV_PIX_FMT_YUYV422},
  };
  const auto* const found = std::ranges::find(kFormats, format, &Pair::aravis);
  return found == std::end(kFormats) ? -1 : found->ffmpeg;
}

}  // namespace raystage::ingest
