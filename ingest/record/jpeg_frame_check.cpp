// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/jpeg_frame_check.h"

#include "ingest/sources/jpeg_markers.h"
#include "store/jpeg/markers.h"

namespace raystage::ingest {
namespace {

/// Removes the zeros with which some cameras fill the last packet.
std::span<const std::byte> without_filler(std::span<const std::byte> jpeg) {
  while (!jpeg.empty() && jpeg.back() == std::byte{0}) jpeg = jpeg.first(jpeg.size() - 1);
  return jpeg;
}

bool ends_with_eoi(std::span<const std::byte> jpeg) {
  return jpeg.size() >= 2 && jpeg[jpeg.size() - 2] == std::byte{0xFF} &&
         jpeg.back() == std::byte{store::kMarkerEoi};
}

}  // namespace

store::FrameStatus check_jpeg_frame(std::span<const std::byte> jpeg, int width, int height) {
  jpeg = without_filler(jpeg);
  if (!ends_with_eoi(jpeg)) return store::FrameStatus::kTorn;
  const JpegMarkerInfo header = read_jpeg_header(jpeg);
  if (header.width == 0) return store::FrameStatus::kTorn;
  const bool fits = header.width == width && header.height == height;
  return fits ? store::FrameStatus::kStored : store::FrameStatus::kUnreadable;
}

}  // namespace raystage::ingest
