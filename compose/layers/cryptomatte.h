// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// Returns MurmurHash3_x86_32 with seed 0 (Appleby), the hash of names in Cryptomatte.
std::uint32_t murmur3_32(std::string_view text);

/// Returns the id of an object: the hash of its name as the bits of a normal float. Source:
/// Friedman and Jones, "Fully automatic ID mattes with support for motion blur and transparency",
/// SIGGRAPH 2015; Cryptomatte's specification 1.2.
float object_id(std::string_view name);

/// Returns the value of `cryptomatte/<key>/manifest`: {"name": "hash in hex", ...}.
std::string cryptomatte_manifest(std::span<const std::string> names);

/// Returns the key of the attributes: the first 7 hex digits of the hash of "CryptoObject".
std::string cryptomatte_key();
inline constexpr const char* kCryptomatteName = "CryptoObject";

/// Assigns all pixels of an image to one object.
void assign_object_id(LayerImage& image, float id);

/// Returns the ids of an image as channels CryptoObject00 to 02, by descending coverage; 0 for
/// none. R is an id, G its coverage (the object's share of the pixel), B and A those of the next
/// object.
std::vector<Aov> cryptomatte_aovs(const LayerImage& image);

}  // namespace raystage::compose
