// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "depths/depth_encoding.h"
#include "images/exr_reader.h"
#include "images/image_reader.h"
#include "render/depth/inverse_depth_map.h"

namespace raystage::depths {

/// Returns whether a file's extension is that of EXR (.exr) or PNG (.png) files, of any case.
bool is_exr_file(const std::filesystem::path& file);
bool is_png_file(const std::filesystem::path& file);

/// Reads depth images in confined processes. Thread-safe.
class DepthImageReader {
 public:
  DepthImageReader();

  /// Returns the inverse of the quantity of the encoding, 1/m. Values that are 0, infinite or no
  /// numbers become render::kUnknownDepth. Throws Error (bad input) if the file is damaged, has not
  /// the channel or the bits that the encoding needs, is larger than render::kMaxImportedPixels,
  /// has negative depths or ones below a micrometre, or no known depth.
  render::InverseDepthMap read(const std::filesystem::path& file,
                               const DepthEncoding& encoding) const;

 private:
  render::InverseDepthMap read_exr(const std::filesystem::path& file,
                                   const DepthEncoding& encoding) const;
  render::InverseDepthMap read_png(const std::filesystem::path& file,
                                   const DepthEncoding& encoding) const;

  images::ExrReader exr_;
  images::ImageReader png_;
};

/// Returns a map as a PNG file of 16-bit codes of DepthEncoding::inverse_range. Throws Error
/// (failed) if it cannot be encoded; `name`: for errors.
std::vector<std::byte> encode_depth_png(const render::InverseDepthMap& map,
                                        const schemas::DepthRange& range, const std::string& name);

}  // namespace raystage::depths
