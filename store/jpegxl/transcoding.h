// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raystage::store {

/// Returns a JPEG XL container from which reconstruct_jpeg() returns the same bytes. `effort`: 1 to
/// 9, as cjxl's. Throws std::runtime_error with the reason if libjxl does not accept the JPEG, or
/// std::bad_alloc. Only for decoders' programs and tests: libjxl reads bytes of strangers.
std::vector<std::byte> transcode_jpeg(std::span<const std::byte> jpeg, int effort);

/// Returns the JPEG of `size` bytes that a container was made from, without decoding pixels.
/// A picture of more than `max_pixels` is refused before anything is decoded. Throws
/// std::runtime_error with the reason, or std::bad_alloc. For the same programs.
std::vector<std::byte> reconstruct_jpeg(std::span<const std::byte> container, std::size_t size,
                                        std::uint64_t max_pixels);

}  // namespace raystage::store
