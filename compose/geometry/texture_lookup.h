// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <string_view>

#include "sandbox/decoder_process.h"

namespace raystage::images {
class ImageSession;
}  // namespace raystage::images

namespace raystage::compose {

/// Interface of the module lib/raystage/raystage-textures.so: OpenImageIO's texture system. It is a
/// module because loading OpenImageIO and the 240 libraries that it needs takes half a second, only
/// spent on shots with textures. For the functions see Textures.
class TextureLookup {
 public:
  using Handle = const void*;
  virtual ~TextureLookup() = default;
  /// `open_file`: opens the file of this name.
  virtual Handle open(const std::string& name, const sandbox::OpenFile& open_file) = 0;
  /// Opens an image in memory. `name`: unique. `format`: extension of such a file. `bytes`: of it,
  /// referred to.
  virtual Handle open_bytes(const std::string& name, const std::string& format,
                            std::string_view bytes) = 0;
  virtual Eigen::Vector3f color(Handle texture, float u, float v, float width) const = 0;
  virtual Eigen::Vector3f environment_color(Handle texture, const Eigen::Vector3d& direction,
                                            float width) const = 0;
};

/// Entry point of the module, under this name. The caller owns the result, which reads files by the
/// session. Raise the number when TextureLookup changes: a module of another version is refused
/// then.
using OpenTextureLookup = TextureLookup*(images::ImageSession& session, std::size_t cache_bytes);
inline constexpr const char* kOpenTextureLookup = "raystage_open_texture_lookup_4";
inline constexpr const char* kTextureModule = "raystage-textures.so";

}  // namespace raystage::compose
