// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace raystage::store {

/// A request to raystage-decode-group, as ByteWriter writes it: codec (std::uint8_t), width and
/// height of the camera (std::int32_t), number of frames (std::uint32_t), then each frame by
/// write_plain(). The result is as many JPEGs, each by write_plain().
struct GroupRequest {
  std::uint8_t codec = 0;
  std::int32_t width = 0, height = 0;
  std::uint32_t frames = 0;
};

}  // namespace raystage::store
