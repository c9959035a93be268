// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace raystage::store {

/// The structure of a JPEG file that partial decoding needs. Holds no pixel bytes.
///
/// A baseline scan with restart markers is a sequence of independent `segments` of
/// `restart_interval` MCUs each, in raster order (ITU-T T.81 B.2.4.4). A segment may continue in
/// the next MCU row. If `baseline_ycc` is false, restart_interval is 0 and the scan counts as one
/// segment.
struct JpegLayout {
  int width = 0, height = 0;               ///< pixels
  int components = 0;                      ///< 1 or 3
  int h[3] = {1, 1, 1}, v[3] = {1, 1, 1};  ///< sampling factors per component
  int mcu_width = 8, mcu_height = 8;       ///< pixels
  int mcus_per_row = 0, mcu_rows = 0;
  int restart_interval = 0;  ///< MCUs per segment; 0: no restart markers
  /// 8-bit Huffman baseline, one interleaved scan, grey or YCbCr: what region decoding needs in
  /// addition to restart markers
  bool baseline_ycc = false;
  std::size_t sof_offset = 0;   ///< of the SOF marker's 0xFF
  std::size_t scan_offset = 0;  ///< first byte of entropy-coded data (of the first scan)
  std::size_t scan_end = 0;     ///< one past its last byte: the next marker
  std::vector<std::uint32_t> segment_offset;  ///< first byte of each segment, then scan_end + 2

  bool regions_decodable() const { return baseline_ycc && restart_interval > 0; }
  int segment_count() const { return static_cast<int>(segment_offset.size()) - 1; }
  int mcu_count() const { return mcus_per_row * mcu_rows; }
};

/// Returns the layout of a JPEG file: reads its markers and finds segments by scanning for RSTn.
/// Bytes after EOI are ignored. Throws Error (bad input) with the byte offset if the file
/// - is not a JPEG or is truncated (no EOI, or too few bytes for its size),
/// - has a wrong number of segments or segments out of order,
/// - has neither one (grey) nor three components, or samples of other than 8 bits.
/// `name` is the file for errors.
JpegLayout parse_jpeg_layout(std::span<const std::byte> jpeg, std::string_view name);

}  // namespace raystage::store
