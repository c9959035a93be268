// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>

namespace raystage {

/// What the module lib/raystage/raystage-textures.so does: OpenImageIO's texture system. A module
/// of its own, because loading OpenImageIO and the 240 libraries that it needs takes half a second,
/// which no shot without textures should pay. See Textures for what the functions do.
class TextureLookup {
 public:
  using Handle = const void*;
  virtual ~TextureLookup() = default;
  virtual Handle open(const std::filesystem::path& file) = 0;
  virtual Eigen::Vector3f color(Handle texture, float u, float v, float width) const = 0;
  virtual Eigen::Vector3f around(Handle texture, const Eigen::Vector3d& direction,
                                 float width) const = 0;
};

/// The module's entry, under this name; the caller owns what it returns.
using OpenTextureLookup = TextureLookup*(std::size_t cache_bytes);
inline constexpr const char* kOpenTextureLookup = "raystage_open_texture_lookup";
inline constexpr const char* kTextureModule = "raystage-textures.so";

}  // namespace raystage
