// SPDX-License-Identifier: Apache-2.0
// Internal to ingest/sources: finds and configures a camera through Aravis.
#pragma once

#include <memory>
#include <string>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

extern "C" {
#include <arv.h>
}

namespace raystage::ingest {

struct GObjectDeleter {
  void operator()(void* object) const { g_object_unref(object); }
};
template <typename T>
using GObjectPtr = std::unique_ptr<T, GObjectDeleter>;

/// Owns an error that Aravis reports.
class GErrorHolder {
 public:
  GErrorHolder() = default;
  ~GErrorHolder() { g_clear_error(&error_); }
  GErrorHolder(const GErrorHolder&) = delete;
  GErrorHolder& operator=(const GErrorHolder&) = delete;

  /// Clears the error and returns the argument of an Aravis call that may fail.
  GError** clear_and_get() {
    g_clear_error(&error_);
    return &error_;
  }
  explicit operator bool() const { return error_ != nullptr; }
  std::string text() const { return error_ == nullptr ? "" : error_->message; }
  /// Returns whether the camera answered that it has no such setting or value. Otherwise it did not
  /// answer, or its description of itself is damaged.
  bool is_refusal() const {
    for (const int code : {ARV_DEVICE_ERROR_WRONG_FEATURE, ARV_DEVICE_ERROR_FEATURE_NOT_FOUND}) {
      if (g_error_matches(error_, ARV_DEVICE_ERROR, code)) return true;
    }
    for (const int code : {ARV_GC_ERROR_OUT_OF_RANGE, ARV_GC_ERROR_ENUM_ENTRY_NOT_FOUND}) {
      if (g_error_matches(error_, ARV_GC_ERROR, code)) return true;
    }
    return false;
  }

 private:
  GError* error_ = nullptr;
};

/// Opens the camera with the Aravis id, address or serial number `device`, or the first camera
/// found if `device` is empty. Throws Error (failed) with a list of the cameras found.
GObjectPtr<ArvCamera> open_aravis_camera(const std::string& device);

/// Sets exposure, gain, frame rate, trigger, pixel format and packet options. Throws Error (bad
/// input) with the setting, the values that the device allows and the device's message.
void configure_aravis_camera(ArvCamera* camera, const schemas::RecordConfig::AravisSource& source);

/// Returns the AVPixelFormat of a GenICam pixel format, or -1 if it is not supported.
int av_pixel_format(ArvPixelFormat format);

}  // namespace raystage::ingest
