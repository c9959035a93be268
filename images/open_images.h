// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

namespace raystage::images {

/// The images that raystage-decode-image has open.
class OpenImages {
 public:
  OpenImages();
  ~OpenImages();

  /// Answers a request, see ImageRequest. Throws std::runtime_error with the reason if an image
  /// cannot be read, or is larger than the memory that was granted; on damaged files anything may
  /// happen.
  std::vector<std::byte> answer(std::span<const std::byte> request);

 private:
  class Image;
  std::map<std::uint32_t, std::unique_ptr<Image>> images_;

  Image& image(std::uint32_t number) const;
};

}  // namespace raystage::images
