// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <span>
#include <vector>

#include "images/image_requests.h"

namespace raystage::images {

/// The PNG and JPEG images that raystage-decode-texture has open. They are decoded as a whole when
/// rows are wanted, and kept while all need at most twice the memory that one may need.
class OpenTextures {
 public:
  /// Answers a request, see ImageRequest. Throws std::runtime_error with the reason if an image
  /// cannot be read, is of another format, or is larger than the memory that was granted; on
  /// damaged files anything may happen.
  std::vector<std::byte> answer(std::span<const std::byte> request);

 private:
  struct Image {
    ImageSource source;
    ImageProperties properties;
    std::vector<std::uint8_t> codes;  ///< bytes; empty: not decoded now
  };

  Image& image(std::uint32_t number);
  /// Decodes an image unless it is decoded, and evicts the least recently used others.
  void decode(std::uint32_t number);
  /// Evicts decoded images, the least recently used first, until they need at most `bytes`.
  void evict(std::size_t bytes);
  std::vector<std::byte> rows(std::uint32_t number, int begin, int end, PixelType type);

  std::map<std::uint32_t, Image> images_;
  std::list<std::uint32_t> decoded_;  ///< the one used last comes first
};

}  // namespace raystage::images
