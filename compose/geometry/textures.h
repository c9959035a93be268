// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <memory>

#include "compose/geometry/texture_lookup.h"

namespace raystage {

/// Pictures on surfaces and around the scene, through OpenImageIO's texture system: loaded in
/// tiles, in as much detail as is looked at, within a bound of memory. Files of 8 and 16 bit
/// integers hold sRGB codes, others scene-linear values. Looking up is thread-safe. Nothing is
/// loaded before the first is opened.
class Textures {
 public:
  using Handle = TextureLookup::Handle;

  /// `working_from_rec709`: from the files' primaries to those of the scene.
  explicit Textures(std::size_t cache_bytes,
                    const Eigen::Matrix3f& working_from_rec709 = Eigen::Matrix3f::Identity())
      : cache_bytes_(cache_bytes), working_from_rec709_(working_from_rec709) {}

  /// Whether any is open.
  bool is_used() const { return lookup_ != nullptr; }
  const Eigen::Matrix3f& working_from_rec709() const { return working_from_rec709_; }

  /// Throws Error (bad input) where the file is missing or no picture, Error (failed) where the
  /// module cannot be loaded from ../lib/raystage, relative to the executable.
  Handle open(const std::filesystem::path& file);

  /// Scene-linear R, G, B at (u, v), (0, 0) the lower left corner, repeated beyond; blurred over
  /// `width` of either.
  Eigen::Vector3f color(Handle texture, float u, float v, float width) const {
    return working_from_rec709_ * lookup_->color(texture, u, v, width);
  }
  /// Of a picture all around (latitude by longitude, y up, its middle at -z, -x to the left of it),
  /// seen in `direction`, unit; blurred over `width`, radians.
  Eigen::Vector3f around(Handle texture, const Eigen::Vector3d& direction, float width) const {
    return working_from_rec709_ * lookup_->around(texture, direction, width);
  }

 private:
  std::size_t cache_bytes_;
  Eigen::Matrix3f working_from_rec709_;
  std::unique_ptr<TextureLookup> lookup_;
};

}  // namespace raystage
