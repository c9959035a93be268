// SPDX-License-Identifier: Apache-2.0
// Inside ingest/sources only: finding and setting up a camera of Aravis.
#pragma once

#include <memory>
#include <string>

#include "ingest/sources/frame_source.h"
#include "schemas/record_config.h"

extern "C" {
#include <arv.h>
}

namespace raystage {

struct GObjectDeleter {
  void operator()(void* object) const { g_object_unref(object); }
};
template <typename T>
using GObjectPtr = std::unique_ptr<T, GObjectDeleter>;

/// One of Aravis' errors, freed at the end.
class GErrorHolder {
 public:
  GErrorHolder() = default;
  ~GErrorHolder() { g_clear_error(&error_); }
  GErrorHolder(const GErrorHolder&) = delete;
  GErrorHolder& operator=(const GErrorHolder&) = delete;

  /// For a call that reports into it; empty before each.
  GError** clear_and_get() {
    g_clear_error(&error_);
    return &error_;
  }
  explicit operator bool() const { return error_ != nullptr; }
  std::string text() const { return error_ == nullptr ? "" : error_->message; }

 private:
  GError* error_ = nullptr;
};

/// Opens the camera that `device` names: Aravis' id, an address, or a serial number; empty: the
/// first found. Throws Error (failed) with what was found instead.
GObjectPtr<ArvCamera> open_aravis_camera(const std::string& device);

/// Exposure, gain, rate, trigger, pixel format, packets. Throws Error (bad input) that names the
/// setting, what the device allows and what it says.
void configure_aravis_camera(ArvCamera* camera, const RecordConfig::AravisSource& source);

/// FFmpeg's pixel format (AVPixelFormat) for a GenICam one; -1: none of those we take.
int av_pixel_format(ArvPixelFormat format);

}  // namespace raystage
