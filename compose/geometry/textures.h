// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/contained_path.h"
#include "compose/geometry/mesh.h"
#include "compose/geometry/texture_lookup.h"
#include "sandbox/decoder_process.h"

namespace raystage::compose {

/// Looks up textures and environment images with OpenImageIO's texture system, which loads tiles of
/// the needed MIP levels within a memory budget. Files of 8 and 16 bit integers hold sRGB codes,
/// others scene-linear values. Lookups are thread-safe. The first open() loads the
/// module. A lookup throws Error (bad input) if the file is damaged there.
class Textures {
 public:
  using Handle = TextureLookup::Handle;

  /// `cache_bytes`: of pixels; `image_bytes`: that the pixels of a file without tiles may need.
  /// `working_from_rec709`: converts the files' primaries to those of the working space.
  Textures(std::size_t cache_bytes, std::size_t image_bytes,
           const Eigen::Matrix3f& working_from_rec709 = Eigen::Matrix3f::Identity());
  ~Textures();

  /// Returns whether any texture is open.
  bool is_used() const { return lookup_ != nullptr; }
  const Eigen::Matrix3f& working_from_rec709() const { return working_from_rec709_; }

  /// Opens a texture. Throws Error (bad input) if the file is missing or no image, Error (failed)
  /// if the module cannot be loaded from lib/raystage.
  Handle open(const std::filesystem::path& file);
  /// Opens a texture that a mesh file names. Throws Error (bad input) also if it is outside of the
  /// folder, or behind a link unless these are permitted.
  Handle open(const ContainedPath& file);
  /// Opens an image of a mesh file, which is kept. Throws Error as open() does.
  Handle open(std::shared_ptr<const EmbeddedImage> image);

  /// Returns scene-linear R, G, B at (u, v), filtered over `width` in both. (0, 0) is the lower
  /// left corner; the texture repeats.
  Eigen::Vector3f color(Handle texture, float u, float v, float width) const {
    return working_from_rec709_ * lookup_->color(texture, u, v, width);
  }
  /// Returns the colour of an environment image in `direction` (unit), filtered over `width`
  /// radians. Latitude by longitude, y up; -z is at the centre, -x to the left of it.
  Eigen::Vector3f environment_color(Handle texture, const Eigen::Vector3d& direction,
                                    float width) const {
    return working_from_rec709_ * lookup_->environment_color(texture, direction, width);
  }

 private:
  std::size_t cache_bytes_, image_bytes_;
  Eigen::Matrix3f working_from_rec709_;
  Handle open_by(const std::string& name, const sandbox::OpenFile& open_file);
  /// `start`: starts the decoder of the first texture.
  void load_lookup(const std::function<void(images::ImageSession&)>& start);

  std::vector<std::shared_ptr<const EmbeddedImage>> images_;  // the lookup refers to their bytes
  std::unique_ptr<images::ImageSession> session_;             // before the lookup, which uses it
  std::unique_ptr<TextureLookup> lookup_;
};

}  // namespace raystage::compose
