// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenEXR/ImfCompression.h>
#include <half.h>

#include <cstddef>
#include <span>
#include <vector>

#include "compose/exr/exr_layout.h"

namespace raystage::testing {

/// The layers of a file with their pixels as OpenEXR takes them: the peer of compose::encode_exr().
class OpenExrEncoding {
 public:
  explicit OpenExrEncoding(std::span<const compose::ExrLayer> layers, int width, int height);

  /// Writes a file of one part per layer to memory by OpenEXR, without threads. `zip_level`: of
  /// zlib, 4 by default in OpenEXR. Returns its bytes.
  std::size_t write(Imf::Compression colours, Imf::Compression data, int zip_level) const;

 private:
  struct Part {
    std::vector<half> halves;   ///< of layers that are stored as halves
    std::vector<float> floats;  ///< of the others
    std::size_t channels = 0;
    bool is_colour = false;
  };
  int width_, height_;
  std::vector<Part> parts_;
};

}  // namespace raystage::testing
