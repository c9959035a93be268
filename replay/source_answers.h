// SPDX-License-Identifier: Apache-2.0
// Answers to requests for source frames: mosaics, single cameras, epipolar-plane images,
// thumbnails.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "replay/view_rendering.h"

namespace raystage::replay {

/// A picture, and what it shows.
struct SourceAnswer {
  PictureContent content = PictureContent::kSource;
  std::vector<std::byte> message;
};

/// Answers a message of the type kMosaic, kSource or kEpi. Throws Error (bad input) for cameras and
/// frames that are not there.
SourceAnswer answer_source_request(const ShownShot& shown, const schemas::ViewerMessage& request);

/// Answers a message of the type kThumbnail. `take`: its folder. Throws Error (bad input).
SourceAnswer answer_thumbnail_request(const std::filesystem::path& take,
                                      const schemas::ViewerMessage& request);

/// Returns a picture as JPEG, in the quality for source frames.
std::vector<std::byte> encode_source_picture(const store::RgbImage& picture);

}  // namespace raystage::replay
