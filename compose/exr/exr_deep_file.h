// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "compose/exr/exr_header.h"

namespace raystage {

/// A view's samples, as ExrDeepView::begin counts them; all of one size.
struct ExrDeepView {
  std::string name;                      ///< "left", "right"; "" where there is just one
  std::span<const std::uint32_t> begin;  ///< of each pixel's samples, row by row, and the end
  std::span<const float> samples;        ///< R, G, B, A (premultiplied), Z each; front to back
};

/// The bytes of a deep scanline EXR: half R, G, B, A, float Z, a part for each view. Compression is
/// ZIPS unless it is to be none or rle: deep files know no other.
std::vector<std::byte> encode_deep_exr(std::span<const ExrDeepView> views,
                                       std::span<const ExrCamera> cameras,
                                       const ExrMetadata& metadata);

/// encode_deep_exr() to a file, under a temporary name and renamed. Returns the bytes written.
/// Throws Error (failed) for the disk.
std::size_t write_deep_exr(std::span<const ExrDeepView> views, std::span<const ExrCamera> cameras,
                           const ExrMetadata& metadata, const std::filesystem::path& file);

}  // namespace raystage
