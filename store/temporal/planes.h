// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace raystage::store {

/// Luma samples from one chroma sample to the next, in rows and columns.
enum class ChromaStep : std::uint8_t {
  k444 = 1,  ///< 4:4:4
  k420 = 2   ///< 4:2:0
};

/// Y'CbCr 4:2:0 or 4:4:4, 8 bits, full range (JFIF): the form in which frames are encoded as video.
/// The planes are those of the coded picture, see coded_side().
struct Planes {
  int width = 0, height = 0;  ///< of the coded luma
  ChromaStep chroma = ChromaStep::k420;
  std::array<std::vector<std::uint8_t>, 3> plane{};  ///< Y, Cb, Cr; rows without gaps
};

/// Returns the side of the coded picture for a side of the camera's, pixels: a multiple of 8 and at
/// least 64, as encoders require. Readers cut the rest off.
int coded_side(int side);

/// Returns the planes of a JPEG, its last column and row repeated up to the coded size. Chroma of
/// the same sampling is taken as it is; for 4:2:0 that of others is averaged over 2 x 2 pixels, for
/// 4:4:4 it is repeated. Throws Error (bad input) if the JPEG is damaged, of another size, or
/// neither Y'CbCr nor grey.
Planes planes_of_jpeg(std::span<const std::byte> jpeg, int width, int height, std::string_view name,
                      ChromaStep chroma = ChromaStep::k420);

/// Returns the sampling that loses no chroma of a JPEG: 4:4:4 if it has a chroma sample of each
/// pixel, otherwise 4:2:0. Throws Error (bad input) if its header is damaged.
ChromaStep chroma_of_jpeg(std::span<const std::byte> jpeg, std::string_view name);

/// A decoded picture in the memory of a decoder.
struct PlanesView {
  std::array<const std::uint8_t*, 3> plane{};
  std::array<std::ptrdiff_t, 3> stride{};  ///< bytes from row to row
  ChromaStep chroma = ChromaStep::k420;
};

/// Returns the upper left width x height pixels of planes as a JPEG of the same chroma sampling
/// with restart markers: the planes' own samples at quantiser step 1, so that it differs from them
/// by rounding only. The planes must have coded_side() columns and rows.
std::vector<std::byte> jpeg_of_planes(const PlanesView& planes, int width, int height);

/// Returns the mean square error of luma and chroma samples of the camera's part of two pictures
/// of the same chroma sampling.
double mean_square_error(const Planes& a, const Planes& b, int width, int height);

}  // namespace raystage::store
