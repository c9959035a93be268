// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "compose/exr/exr_header.h"

namespace raystage::compose {

/// Deep samples of a view. All views of a file have the same size.
struct ExrDeepView {
  std::string name;                      ///< "left", "right"; "" if there is only one
  std::span<const std::uint32_t> begin;  ///< index of each pixel's first sample, then the end
  std::span<const float> samples;        ///< R, G, B, A (premultiplied), Z of each; front to back
};

/// Returns the bytes of a deep scanline EXR: half R, G, B, A, float Z, one part per view. The
/// compression is that of the metadata if it is none or rle, otherwise zips: deep files have no
/// other.
std::vector<std::byte> encode_deep_exr(std::span<const ExrDeepView> views,
                                       std::span<const ExrCamera> cameras,
                                       const ExrMetadata& metadata);

}  // namespace raystage::compose
