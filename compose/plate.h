// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "compose/color/color_config.h"
#include "compose/layers/fingerprint.h"
#include "compose/layers/layer_image.h"
#include "compose/sequence_name.h"
#include "schemas/shot_document.h"

namespace raystage {

/// A layer of pictures made elsewhere, as large as the shot's: EXR (its Z counts where the layer
/// says no depth), PNG or JPEG.
class PlateLayer {
 public:
  /// `folder`: what the plate's path is relative to. `config`: of colours, for plates that are not
  /// linear Rec.709 or sRGB; none: the built-in one.
  PlateLayer(const ShotDocument& shot, std::size_t index, const std::filesystem::path& folder,
             std::optional<ColorConfig> config);

  std::filesystem::path file(int frame) const;
  /// Throws Error (bad input) where the frame's file is missing, of a kind that is not read, or not
  /// as large as the shot's pictures.
  void check_file(int frame) const;
  /// In the scene's colours, with nothing in the overscan. Throws Error (bad input) for a file that
  /// cannot be read or is not as large as the shot's pictures.
  LayerImage image(int frame, int overscan_x, int overscan_y) const;
  void add_to(Fingerprint& print, int frame) const;

 private:
  void check_size(const std::array<int, 2>& size, const std::filesystem::path& path) const;
  /// Premultiplied light and depth, of the picture alone.
  LayerImage read(const std::filesystem::path& path) const;
  ColorConfig colors() const;
  void turn_into_scene_colors(LayerImage& image, const std::string& space) const;

  ShotDocument::Plate document_;
  int width_ = 0, height_ = 0;
  SequenceName name_;
  std::optional<ColorConfig> config_;
};

}  // namespace raystage
