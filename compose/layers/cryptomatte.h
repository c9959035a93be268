// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/layers/layer_image.h"

namespace raystage {

/// MurmurHash3_x86_32 with seed 0 (Appleby), which names things in Cryptomattes.
std::uint32_t murmur3_32(std::string_view text);

/// The id of an object: its name's hash as the bits of a float, made a normal number (Friedman and
/// Jones, "Fully automatic ID mattes with support for motion blur and transparency", SIGGRAPH 2015;
/// Cryptomatte's specification 1.2).
float object_id(std::string_view name);

/// Objects of a file, as `cryptomatte/<key>/manifest` has them: {"name": "hash in hex", ...}.
std::string cryptomatte_manifest(std::span<const std::string> names);

/// First 7 hex digits of the hash of "CryptoObject": the key of its attributes.
std::string cryptomatte_key();
inline constexpr const char* kCryptomatteName = "CryptoObject";

/// Makes all of an image one object.
void make_one_object(LayerImage& image, float id);

/// The image's ids as channels: CryptoObject00 to 02, each R = id, G = coverage, B, A the same of
/// the next, by falling coverage, which is the object's share of the pixel. Where there is nothing,
/// 0.
std::vector<Aov> cryptomatte_aovs(const LayerImage& image);

}  // namespace raystage
