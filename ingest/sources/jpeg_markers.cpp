// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/jpeg_markers.h"

#include "base/error.h"
#include "store/jpeg/layout.h"
#include "store/jpeg/markers.h"

namespace raystage {

JpegMarkerInfo read_jpeg_header(std::span<const std::byte> jpeg) {
  JpegMarkerInfo glance;
  try {
    MarkerReader reader(jpeg, "");
    reader.read_soi();
    for (;;) {
      const Marker marker = reader.next();
      // SOF0 to SOF15 without DHT, JPG and DAC, which stand among them.
      const bool frame_header = marker.code >= 0xC0 && marker.code <= 0xCF && marker.code != 0xC4 &&
                                marker.code != 0xC8 && marker.code != 0xCC;
      if (frame_header && marker.body.size() >= 5) {
        const auto at = [&](std::size_t i) { return std::to_integer<int>(marker.body[i]); };
        glance.height = at(1) * 256 + at(2);
        glance.width = at(3) * 256 + at(4);
        return glance;
      }
      if (marker.code == kMarkerSos || marker.code == kMarkerEoi) return glance;
    }
  } catch (const Error&) {
    return glance;
  }
}

JpegMarkerInfo scan_jpeg_markers(std::span<const std::byte> jpeg) {
  try {
    const JpegLayout layout = parse_jpeg_layout(jpeg, "");
    return {.width = layout.width, .height = layout.height, .whole = true};
  } catch (const Error&) {
    return read_jpeg_header(jpeg);
  }
}

}  // namespace raystage
