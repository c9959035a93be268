// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "images/exr_reader.h"
#include "images/image_reader.h"
#include "ingest/movie_frame.h"
#include "ingest/source_image.h"
#include "schemas/pixel_encoding.h"
#include "store/jpegxl/deep_picture.h"

namespace raystage::ingest {

/// A source picture of more than 8 bits as a take stores it.
struct DeepSource {
  store::DeepPicture picture;
  double peak = 0;              ///< linear light of its brightest sample, white = 1
  std::int64_t not_finite = 0;  ///< samples that were replaced: infinite, or not numbers
};

/// Returns how a take stores an image of more than 8 bits, or nullopt if the image has 8 bits at
/// most. Floats become half floats, with the chromaticities of an EXR file; integers of 16 bits
/// keep them. `linear`: values are scene-linear light. Without it floating-point images give
/// nullopt, too: they are rejected later. Throws Error (bad input) if the file is not an image.
std::optional<schemas::PixelEncoding> deep_encoding_of_image(const images::ImageReader& reader,
                                                             const images::ExrReader& exr_reader,
                                                             const std::filesystem::path& file,
                                                             bool linear);

/// The same of a movie. Its R, G, B get two bits more than its components, at most 16, so that the
/// conversion to RGB costs less than an eighth of a code.
std::optional<schemas::PixelEncoding> deep_encoding_of_movie(const MovieFormat& format);

/// Reads an image in an encoding. Grey becomes R = G = B; alpha is dropped. Floats are rounded to
/// half floats; infinities become the largest one, what is not a number 0. Throws Error (bad input)
/// if the file is unreadable, is not of `size`, or has other primaries than the encoding.
DeepSource read_deep_image(const images::ImageReader& reader, const images::ExrReader& exr_reader,
                           const std::filesystem::path& file, SourceImageSize size,
                           const schemas::PixelEncoding& encoding);

/// Rounds a movie's picture of 16 bits to an encoding.
DeepSource deep_source_of_movie(const store::DeepPicture& picture,
                                const schemas::PixelEncoding& encoding);

}  // namespace raystage::ingest
