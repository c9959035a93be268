// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as the link of a temporal frame, and decodes them as a group of one or two
// frames, as raystage-decode-group does: HEVC, then AV1.
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <span>
#include <vector>

#include "store/temporal/group_decoding.h"
#include "store/temporal/temporal_frame.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace raystage::store;
  const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  if (const auto link = read_frame_link(bytes)) {
    if (link->position >= kMaxGroupFrames || size < kFrameLinkBytes - 8) std::abort();
  }
  std::vector<std::vector<std::byte>> frames;
  const std::size_t half = size / 2;
  frames.emplace_back(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(half));
  frames.emplace_back(bytes.begin() + static_cast<std::ptrdiff_t>(half), bytes.end());
  for (const VideoCodec codec : {VideoCodec::kHevc, VideoCodec::kAv1}) {
    try {
      if (decode_group(codec, 64, 64, frames).size() != frames.size()) std::abort();
    } catch (const std::exception&) {  // refused
    }
  }
  return 0;
}
