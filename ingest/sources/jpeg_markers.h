// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

namespace raystage {

/// What the markers of a JPEG say, without decoding it.
struct JpegMarkerInfo {
  int width = 0, height = 0;  ///< pixels; 0 where that cannot be read
  bool whole = false;         ///< every marker is in its place, up to the end
};

/// Scans all markers. Does not detect damage within the entropy-coded bytes that leaves all markers
/// in place.
JpegMarkerInfo scan_jpeg_markers(std::span<const std::byte> jpeg);

/// The size alone, a microsecond: what comes after it may be cut short, `whole` stays false.
JpegMarkerInfo read_jpeg_header(std::span<const std::byte> jpeg);

}  // namespace raystage
