// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace raystage::store {

/// First byte of a request to raystage-transcode-jpeg. What follows, each as ByteWriter writes it:
/// most pixels of a picture (std::uint64_t), then the effort (std::uint8_t) or the bytes of the
/// JPEG (std::uint64_t), then the file. The result is the other file. Of pictures: see
/// picture_requests.h.
enum class TranscodingRequest : std::uint8_t {
  kPack = 1,
  kUnpack = 2,
  kEncodePicture = 3,  ///< encoding, distance (double), effort (std::uint8_t), picture
  kDecodePicture = 4   ///< codestream; result: coded picture
};

}  // namespace raystage::store
