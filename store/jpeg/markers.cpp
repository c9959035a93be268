// SPDX-License-Identifier: Apache-2.0
// Iterates over the markers of a JPEG file (ITU-T T.81 B.1).
#include "store/jpeg/markers.h"

#include <cstring>
#include <utility>

#include "base/error.h"

namespace raystage::store {

void MarkerReader::fail(std::size_t offset, std::string what_happened) const {
  throw Error::bad_input(std::move(what_happened),
                         std::string(name_) + " @byte " + std::to_string(offset),
                         "Replace the file or remove the frame");
}

void MarkerReader::read_soi() {
  if (jpeg_.size() < 2 || jpeg_[0] != std::byte{0xFF} || jpeg_[1] != std::byte{kMarkerSoi})
    fail(0, jpeg_.empty() ? "the file is empty" : "the file is not a JPEG");
  at_ = 2;
}

Marker MarkerReader::next() {
  Marker marker;
  marker.offset = at_;
  const auto byte_here = [&] {
    if (at_ >= jpeg_.size()) fail(jpeg_.size(), "the JPEG is truncated");
    return std::to_integer<int>(jpeg_[at_++]);
  };
  if (byte_here() != 0xFF) fail(marker.offset, "a marker is missing");
  do {
    marker.offset = at_ - 1;
    marker.code = byte_here();
  } while (marker.code == 0xFF);
  if (marker.code == 0) fail(marker.offset, "a marker is missing");
  const bool stands_alone = marker.code == 0x01 || (marker.code >= 0xD0 && marker.code <= 0xD9);
  if (!stands_alone) {
    const std::size_t start = at_;
    const int high = byte_here();
    const auto length = static_cast<std::size_t>(high << 8 | byte_here());
    if (length < 2) fail(marker.offset, "a marker's length is below 2");
    if (length > jpeg_.size() - start) fail(jpeg_.size(), "the JPEG is truncated");
    marker.body = jpeg_.subspan(start + 2, length - 2);
    at_ = start + length;
  }
  marker.end = at_;
  return marker;
}

void MarkerReader::skip_scan() {
  for (;;) {
    const void* found =
        at_ < jpeg_.size() ? std::memchr(jpeg_.data() + at_, 0xFF, jpeg_.size() - at_) : nullptr;
    if (found == nullptr) fail(jpeg_.size(), "the JPEG is truncated");
    at_ = static_cast<std::size_t>(static_cast<const std::byte*>(found) - jpeg_.data());
    const int code = at_ + 1 < jpeg_.size() ? std::to_integer<int>(jpeg_[at_ + 1]) : 0;
    if (code == 0xFF) {
      ++at_;
    } else if (code == 0 || (code >= 0xD0 && code <= 0xD7)) {
      at_ += 2;
    } else {
      return;
    }
  }
}

}  // namespace raystage::store
