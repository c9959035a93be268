// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "compose/exr/layout.h"
#include "render/view/view.h"

namespace raystage {

/// Values of a picture beside its colours and depth, interleaved pixel by pixel.
struct Aov {
  std::string layer;                  ///< as EXR files name it: "lf", "N", "albedo" ...
  std::vector<std::string> channels;  ///< "coverage"; "X", "Y", "Z"; ...
  bool is_colour = false;
  float nothing = 0;  ///< where there is nothing to tell
  PixelValues values;
};

/// Objects that are told apart in one pixel: six, as Cryptomatte's readers expect.
inline constexpr std::size_t kIdRanks = 6;

/// What a layer shows of a frame, row-major from the top left.
struct LayerImage {
  int width = 0, height = 0;
  PixelValues rgba;  ///< scene-linear, in the working space, premultiplied
  PixelValues z;     ///< planar depth, metres; +infinity where A is 0 or nothing has a depth
  std::vector<Aov> aovs;
  /// Not asked for: empty. Else kIdRanks pairs a pixel: an object's id, and its share of A; by
  /// falling share, 0 where there are no more.
  PixelValues ids;
  RenderStatistics statistics;
  std::vector<std::string> notes;

  std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

/// A picture of nothing.
LayerImage empty_image(int width, int height);

/// A light field's view, with its coverage, and its cameras and nearest rays where it has them.
LayerImage layer_image(RenderedView view);

/// As an EXR file's view: the picture, `depth`, and the AOVs. Refers to the image.
ExrView exr_view(const LayerImage& image, const std::string& name);

}  // namespace raystage
