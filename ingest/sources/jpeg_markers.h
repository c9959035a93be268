// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

namespace raystage::ingest {

/// Size and completeness of a JPEG according to its markers, without decoding.
struct JpegMarkerInfo {
  int width = 0, height = 0;  ///< pixels; 0 if unreadable
  bool whole = false;         ///< every marker is in place, up to the end
};

/// Scans all markers. Does not detect damage of entropy-coded bytes that leaves the markers intact.
JpegMarkerInfo scan_jpeg_markers(std::span<const std::byte> jpeg);

/// Reads only the size, in about 1 us. `whole` stays false: the data may be truncated after it.
JpegMarkerInfo read_jpeg_header(std::span<const std::byte> jpeg);

}  // namespace raystage::ingest
