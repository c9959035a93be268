// SPDX-License-Identifier: Apache-2.0
// Parses the markers of a JPEG file (ITU-T T.81 annex B) up to its scan, finds the restart markers
// in the scan and checks their order and number. The result has the frame's size and sampling and
// the byte offset of each segment. Nothing is entropy-decoded; the cost is one pass over the bytes
// (marker_search.h).
#include "store/jpeg/layout.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "base/error.h"
#include "store/jpeg/marker_search.h"
#include "store/jpeg/markers.h"

namespace raystage::store {
namespace {

// The 8-bit processes of ITU-T T.81 table B.1 that libjpeg-turbo decodes.
constexpr int kBaseline = 0xC0, kExtended = 0xC1, kProgressive = 0xC2, kArithmetic = 0xC9,
              kProgressiveArithmetic = 0xCA;

constexpr int kMaxScans = 100;  // libjpeg's own progression has 10

std::uint8_t byte_at(std::span<const std::byte> bytes, std::size_t offset) {
  return std::to_integer<std::uint8_t>(bytes[offset]);
}

int word_at(std::span<const std::byte> bytes, std::size_t offset) {
  return byte_at(bytes, offset) << 8 | byte_at(bytes, offset + 1);
}

bool begins_with(std::span<const std::byte> body, std::string_view text) {
  return body.size() >= text.size() && std::memcmp(body.data(), text.data(), text.size()) == 0;
}

class LayoutParser {
 public:
  LayoutParser(std::span<const std::byte> jpeg, std::string_view name)
      : markers_(jpeg, name), jpeg_(jpeg) {}

  JpegLayout parse() {
    read_header();
    find_segments();
    finish();
    return std::move(layout_);
  }

 private:
  void read_header();
  void read_frame(const Marker& marker);
  void read_scan(const Marker& marker);
  void find_segments();
  void finish();
  bool color_is_ycc() const;
  bool sampling_is_decodable() const;

  MarkerReader markers_;
  std::span<const std::byte> jpeg_;
  JpegLayout layout_;
  int process_ = -1;
  int scan_components_ = 0;
  int interval_ = 0;
  bool plain_scan_ = false;
  bool jfif_ = false;
  int adobe_transform_ = -1;
  std::uint8_t component_id_[3] = {};
};

void LayoutParser::read_header() {
  markers_.read_soi();
  for (;;) {
    const Marker marker = markers_.next();
    const auto body = marker.body;
    switch (marker.code) {
      case 0xC0:
      case 0xC1:
      case 0xC2:
      case 0xC3:
      case 0xC5:
      case 0xC6:
      case 0xC7:
      case 0xC9:
      case 0xCA:
      case 0xCB:
      case 0xCD:
      case 0xCE:
      case 0xCF:
        read_frame(marker);
        break;
      case kMarkerDri:
        if (body.size() != 2) markers_.fail(marker.offset, "the DRI marker is damaged");
        interval_ = word_at(body, 0);
        break;
      case kMarkerApp0:
        if (body.size() >= 14 && begins_with(body, std::string_view("JFIF\0", 5))) jfif_ = true;
        break;
      case kMarkerApp14:
        if (body.size() >= 12 && begins_with(body, "Adobe")) adobe_transform_ = byte_at(body, 11);
        break;
      case kMarkerSos:
        read_scan(marker);
        return;
      case kMarkerEoi:
        markers_.fail(marker.offset, "the JPEG ends before its scan");
      default:
        break;
    }
  }
}

void LayoutParser::read_frame(const Marker& marker) {
  const auto body = marker.body;
  if (process_ >= 0) markers_.fail(marker.offset, "there is a second SOF marker");
  process_ = marker.code;
  layout_.sof_offset = marker.offset;
  if (process_ != kBaseline && process_ != kExtended && process_ != kProgressive &&
      process_ != kArithmetic && process_ != kProgressiveArithmetic)
    markers_.fail(marker.offset, "this JPEG process (SOF" + std::to_string(process_ - 0xC0) +
                                     ") is not supported");
  if (body.size() < 6) markers_.fail(marker.offset, "the SOF marker is damaged");
  if (byte_at(body, 0) != 8)
    markers_.fail(marker.offset, "samples have " + std::to_string(byte_at(body, 0)) +
                                     " bits; only 8 are supported");
  layout_.height = word_at(body, 1);
  layout_.width = word_at(body, 3);
  layout_.components = byte_at(body, 5);
  if (layout_.width == 0 || layout_.height == 0)
    markers_.fail(marker.offset, "the picture's size is " + std::to_string(layout_.width) + "x" +
                                     std::to_string(layout_.height));
  if (layout_.components != 1 && layout_.components != 3)
    markers_.fail(marker.offset, "the JPEG has " + std::to_string(layout_.components) +
                                     " components (CMYK?); only grey and colour (3) are supported");
  if (body.size() != 6 + 3 * static_cast<std::size_t>(layout_.components))
    markers_.fail(marker.offset, "the SOF marker is damaged");
  int h_max = 1, v_max = 1;
  for (int c = 0; c < layout_.components; ++c) {
    const std::size_t at = 6 + 3 * static_cast<std::size_t>(c);
    component_id_[c] = byte_at(body, at);
    layout_.h[c] = byte_at(body, at + 1) >> 4;
    layout_.v[c] = byte_at(body, at + 1) & 15;
    if (layout_.h[c] < 1 || layout_.h[c] > 4 || layout_.v[c] < 1 || layout_.v[c] > 4)
      markers_.fail(marker.offset, "a sampling factor is outside of 1-4");
    h_max = std::max(h_max, layout_.h[c]);
    v_max = std::max(v_max, layout_.v[c]);
  }
  if (layout_.components == 1) {  // a scan of one component has MCUs of one block (A.2.2)
    layout_.h[0] = layout_.v[0] = h_max = v_max = 1;
  }
  layout_.mcu_width = 8 * h_max;
  layout_.mcu_height = 8 * v_max;
  layout_.mcus_per_row = (layout_.width + layout_.mcu_width - 1) / layout_.mcu_width;
  layout_.mcu_rows = (layout_.height + layout_.mcu_height - 1) / layout_.mcu_height;
}

void LayoutParser::read_scan(const Marker& marker) {
  if (process_ < 0) markers_.fail(marker.offset, "a scan comes before the SOF marker");
  const auto body = marker.body;
  if (body.empty()) markers_.fail(marker.offset, "the SOS marker is damaged");
  scan_components_ = byte_at(body, 0);
  if (body.size() != 4 + 2 * static_cast<std::size_t>(scan_components_))
    markers_.fail(marker.offset, "the SOS marker is damaged");
  plain_scan_ = scan_components_ == layout_.components;
  for (int c = 0; plain_scan_ && c < scan_components_; ++c)
    plain_scan_ = byte_at(body, 1 + 2 * static_cast<std::size_t>(c)) == component_id_[c];
  layout_.scan_offset = marker.end;
}

// Returns whether libjpeg-turbo (jdapimin.c) would treat the components as grey or YCbCr.
bool LayoutParser::color_is_ycc() const {
  if (layout_.components == 1 || jfif_) return true;
  if (adobe_transform_ >= 0) return adobe_transform_ != 0;
  return !(component_id_[0] == 'R' && component_id_[1] == 'G' && component_id_[2] == 'B');
}

bool LayoutParser::sampling_is_decodable() const {
  int blocks = 0;
  for (int c = 0; c < layout_.components; ++c) {
    if (layout_.mcu_width / 8 % layout_.h[c] != 0 || layout_.mcu_height / 8 % layout_.v[c] != 0)
      return false;
    blocks += layout_.h[c] * layout_.v[c];
  }
  return blocks <= 10;  // B.2.3
}

void LayoutParser::find_segments() {
  const bool huffman = process_ <= kProgressive;
  layout_.baseline_ycc = (process_ == kBaseline || process_ == kExtended) && plain_scan_ &&
                         color_is_ycc() && sampling_is_decodable();
  const bool keep = layout_.baseline_ycc && interval_ > 0;
  const std::vector<std::uint32_t> found = find_restart_markers(jpeg_, layout_.scan_offset);
  const auto code_at = [&](std::size_t offset) { return byte_at(jpeg_, offset + 1); };
  if (found.empty() || (code_at(found.back()) & 0xF8) == 0xD0)
    markers_.fail(jpeg_.size(), "the JPEG is truncated");
  layout_.scan_end = found.back();
  layout_.segment_offset.reserve(keep ? found.size() + 1 : 2);
  layout_.segment_offset.push_back(static_cast<std::uint32_t>(layout_.scan_offset));
  for (std::size_t i = 0; i + 1 < found.size(); ++i) {
    const int number = code_at(found[i]) - 0xD0, expected = static_cast<int>(i % 8);
    if (number != expected)
      markers_.fail(found[i], "restart marker " + std::to_string(number) +
                                  " was found instead of " + std::to_string(expected));
    if (layout_.baseline_ycc && interval_ == 0)
      markers_.fail(found[i], "there is a restart marker, but no DRI marker");
    if (keep) layout_.segment_offset.push_back(found[i] + 2);
  }
  layout_.segment_offset.push_back(static_cast<std::uint32_t>(layout_.scan_end + 2));
  if (keep) {
    layout_.restart_interval = interval_;
    const int segments = (layout_.mcu_count() + interval_ - 1) / interval_;
    if (layout_.segment_count() != segments)
      markers_.fail(layout_.scan_end, "the scan has " + std::to_string(layout_.segment_count()) +
                                          " restart segments, but its size and DRI require " +
                                          std::to_string(segments));
  }
  if (!huffman) return;
  // A Huffman-coded block takes at least one bit (two if not progressive). The check also keeps
  // small hostile files from requesting gigabytes.
  const std::size_t blocks = static_cast<std::size_t>(layout_.mcu_count());
  if (blocks > 8 * (jpeg_.size() - layout_.scan_offset))
    markers_.fail(layout_.scan_end, "the scan is too short for a picture of " +
                                        std::to_string(layout_.width) + "x" +
                                        std::to_string(layout_.height));
}

void LayoutParser::finish() {
  markers_.seek(layout_.scan_end);
  for (int scans = 1;;) {
    const Marker marker = markers_.next();
    if (marker.code == kMarkerEoi) return;
    if (marker.code != kMarkerSos) continue;
    // A scan of a few bytes takes as long to decode as one that refines every block.
    if (++scans > kMaxScans)
      markers_.fail(marker.offset,
                    "the picture has more than " + std::to_string(kMaxScans) + " scans");
    if (plain_scan_ && process_ <= kExtended)
      markers_.fail(marker.offset, "a second scan follows the one that holds the whole picture");
    markers_.skip_scan();
  }
}

}  // namespace

JpegLayout parse_jpeg_layout(std::span<const std::byte> jpeg, std::string_view name) {
  return LayoutParser(jpeg, name).parse();
}

}  // namespace raystage::store
