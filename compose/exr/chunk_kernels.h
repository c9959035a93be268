// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace raystage::compose {

/// Converts `count` values, `stride` apart, to the nearest half, ties to even: as Imath's half.
/// Values are clamped to +-65504; NaN becomes 0. `halves`: 2 * count bytes of any alignment.
void convert_to_halves(const float* values, std::size_t stride, std::size_t count,
                       std::uint8_t* halves);

/// Copies `count` values, `stride` apart; `nan_replacement` replaces NaN. `copies`: 4 * count bytes
/// of any alignment.
void copy_without_nan(const float* values, std::size_t stride, std::size_t count,
                      float nan_replacement, std::uint8_t* copies);

/// Prepares a chunk for ZIP compression (OpenEXR file layout, ZIP_COMPRESSION): the bytes at even
/// positions come before those at odd ones, then each byte but the first is replaced by its
/// difference from the one before it plus 128, modulo 256. `sorted`, `predicted`: as many bytes as
/// `raw`; `sorted` is working memory.
void predict_chunk(std::span<const std::uint8_t> raw, std::span<std::uint8_t> sorted,
                   std::span<std::uint8_t> predicted);

}  // namespace raystage::compose
