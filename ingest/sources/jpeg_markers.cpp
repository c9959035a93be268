// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/jpeg_markers.h"

#include "base/error.h"
#include "store/jpeg/layout.h"
#include "store/jpeg/markers.h"

namespace raystage::ingest {

JpegMarkerInfo read_jpeg_header(std::span<const std::byte> jpeg) {
  JpegMarkerInfo header;
  try {
    store::MarkerReader reader(jpeg, "");
    reader.read_soi();
    for (;;) {
      const store::Marker marker = reader.next();
      // SOF0 to SOF15, but not DHT, JPG and DAC, whose codes are among them.
      const bool frame_header = marker.code >= 0xC0 && marker.code <= 0xCF && marker.code != 0xC4 &&
                                marker.code != 0xC8 && marker.code != 0xCC;
      if (frame_header && marker.body.size() >= 5) {
        const auto at = [&](std::size_t i) { return std::to_integer<int>(marker.body[i]); };
        header.height = at(1) * 256 + at(2);
        header.width = at(3) * 256 + at(4);
        return header;
      }
      if (marker.code == store::kMarkerSos || marker.code == store::kMarkerEoi) return header;
    }
  } catch (const Error&) {
    return header;
  }
}

JpegMarkerInfo scan_jpeg_markers(std::span<const std::byte> jpeg) {
  try {
    const store::JpegLayout layout = store::parse_jpeg_layout(jpeg, "");
    return {.width = layout.width, .height = layout.height, .whole = true};
  } catch (const Error&) {
    return read_jpeg_header(jpeg);
  }
}

}  // namespace raystage::ingest
