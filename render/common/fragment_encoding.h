// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "render/common/fragments.h"

namespace raystage::render {

/// How the samples of fragments are stored in a message.
enum class FragmentEncoding : std::uint8_t {
  /// 16 bytes per pixel, exact.
  kFloat = 0,
  /// 8 bytes per pixel: half floats of sums / 65535. The error of each value is at most 2^-11 of
  /// it.
  kHalf = 1,
  /// One bounding rectangle: R, G, B as a JPEG of sums / 257, clamped to [0, 255]. Weights are not
  /// stored: they depend on geometry alone, so that the reader can compute them.
  kJpeg = 2
};

struct FragmentEncodingOptions {
  FragmentEncoding encoding = FragmentEncoding::kFloat;
  int jpeg_quality = 85;  ///< 1 to 100, libjpeg's scale; chroma has half the resolution
  bool is_valid(std::string* reason) const;
};

/// Counts what messages contain.
struct FragmentCounts {
  std::int64_t fragments = 0, samples = 0, bytes = 0;
  FragmentCounts& operator+=(const FragmentCounts& other) {
    fragments += other.fragments;
    samples += other.samples;
    bytes += other.bytes;
    return *this;
  }
};

/// Returns a message with the fragments of `sums` (R, G, B, weight per pixel in codes, 65535 being
/// full scale; row-major), and adds what it holds to `counts`. Layout: docs/formats/fragments.md.
std::vector<std::byte> encode_fragments(const FragmentTag& tag, std::span<const float> sums,
                                        int width, int height,
                                        const FragmentEncodingOptions& options,
                                        FragmentCounts& counts);

/// Adds the fragments of a message to `sums`. Throws Error (bad input) where the message is
/// damaged, its view has another size or its tag differs from `tag`; `sums` may then contain some
/// of its fragments.
void add_fragments(std::span<const std::byte> message, const FragmentTag& tag, int width,
                   int height, std::span<float> sums);

}  // namespace raystage::render
