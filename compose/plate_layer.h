// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "compose/color/color_config.h"
#include "compose/layers/layer.h"
#include "compose/layers/layer_image.h"
#include "compose/sequence_name.h"
#include "images/exr_reader.h"
#include "images/image_reader.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// A layer of images of the shot's size: EXR (with Z, unless the layer has a depth), PNG or JPEG.
class PlateLayer final : public Layer {
 public:
  /// Checks the colour space; opens no file. `folder`: what the path is relative to. `config`:
  /// OpenColorIO config for plates that are neither linear Rec.709 nor sRGB; none: the built-in
  /// one. `scale`: of the shot's size to that of its files, for drafts; (0, 1]. `memory_bytes`:
  /// that the pixels of a file may need; 0: half of the machine's.
  PlateLayer(const schemas::ShotDocument& shot, std::size_t index,
             const std::filesystem::path& folder, std::optional<ColorConfig> config,
             double scale = 1, std::size_t memory_bytes = 0);

  std::filesystem::path file(int frame) const;
  /// Throws Error (bad input) if the file is missing, not supported, or not of the shot's size.
  void check_file(int frame) const;
  /// Returns the picture in kSceneSpace; the overscan is transparent. Throws Error (bad input) if
  /// the file cannot be read or is not of the shot's size.
  LayerImage image(int frame, int overscan_x, int overscan_y) const;

  void check_frame(const LayerFrameCheck& check) const override;
  void add_to_fingerprint(Fingerprint& print, double frame, const ShownTick& shown) const override;
  std::optional<std::filesystem::path> input_file(int frame) const override { return file(frame); }
  bool is_in_scene_space() const override { return true; }
  std::unique_ptr<const LayerRenderer> make_renderer(
      const LayerRendererOptions& options) const override;

 private:
  void check_size(const std::array<int, 2>& size, const std::filesystem::path& path) const;
  /// Returns premultiplied light and depth, without overscan.
  LayerImage read(const std::filesystem::path& path) const;
  ColorConfig colors() const;
  void convert_to_scene_space(LayerImage& image, const std::string& space) const;

  schemas::ShotDocument::Plate document_;
  int width_ = 0, height_ = 0;
  double scale_ = 1;
  SequenceName name_;
  std::optional<ColorConfig> config_;
  images::ExrReader exr_;
  images::ImageReader png_;
};

}  // namespace raystage::compose
