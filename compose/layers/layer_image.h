// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "compose/exr/exr_layout.h"
#include "render/common/view.h"

namespace raystage::compose {

/// Arbitrary output variable: pixel values other than colour and depth, interleaved by pixel.
struct Aov {
  std::string layer;                  ///< as EXR files name it: "lf", "N", "albedo" ...
  std::vector<std::string> channels;  ///< "coverage"; "X", "Y", "Z"; ...
  bool is_colour = false;
  float empty_value = 0;  ///< value of pixels without data
  render::PixelValues values;
};

/// Largest number of objects per pixel: six, as readers of Cryptomatte expect.
inline constexpr std::size_t kIdRanks = 6;

/// The image of a layer, row-major from the top left.
struct LayerImage {
  int width = 0, height = 0;
  render::PixelValues rgba;  ///< scene-linear, in the working space, premultiplied
  render::PixelValues z;     ///< planar depth, metres; +infinity where A is 0 or there is no depth
  std::vector<Aov> aovs;
  /// Empty unless requested. kIdRanks pairs per pixel: id of an object and its share of A, by
  /// descending share; 0 for none.
  render::PixelValues ids;
  /// Pixels of two surfaces, see render::RenderedView; in the space of `rgba` before it is
  /// converted to the working space.
  std::vector<render::EdgePixel> edges;
  render::RenderStatistics statistics;
  std::vector<std::string> notes;

  std::size_t pixels() const { return static_cast<std::size_t>(width) * height; }
};

/// Returns a transparent image.
LayerImage transparent_layer_image(int width, int height);

/// Returns a view of a light field as a layer image, with its coverage measures as AOVs. A and
/// coverage within 1e-6 of 1 become 1.
LayerImage make_layer_image(render::RenderedView view);

/// Returns colours, `depth` and AOVs as a view of an EXR file. Keeps a reference to the image.
ExrView exr_view(const LayerImage& image, const std::string& name);

}  // namespace raystage::compose
