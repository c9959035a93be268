// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compose/exr/exr_header.h"
#include "compose/exr/exr_layout.h"

namespace raystage::images {
class ExrReader;
}  // namespace raystage::images

namespace raystage::compose {

/// Returns the bytes of a scanline EXR file. `views`: at least one, all with the same layers;
/// `cameras`: one per view, all of one size. Colours are half, see clamp_to_half(); data are float.
/// Deterministic.
std::vector<std::byte> encode_exr(std::span<const ExrView> views,
                                  std::span<const ExrCamera> cameras, const ExrMetadata& metadata);

/// In what a rendered frame may fall short: as ExrMetadata.
struct FrameQuality {
  double covered_share = 1;
  std::vector<std::string> rotten_cameras = {};
};

/// Returns the quality that an EXR file states if it has all pixels of all parts, and `fingerprint`
/// in all headers. Pixels are read but not decompressed. Damaged or missing files are not an error.
/// Throws Error (failed) as sandbox::DecoderProcess does.
std::optional<FrameQuality> find_complete_exr(const images::ExrReader& reader,
                                              const std::filesystem::path& file,
                                              std::string_view fingerprint);
/// Returns whether find_complete_exr() finds it, by a reader of its own.
bool is_complete_exr(const std::filesystem::path& file, std::string_view fingerprint);

/// Returns what a rendered file states of its quality, or else the defaults. Throws Error (bad
/// input) if the file cannot be read.
FrameQuality read_frame_quality(const images::ExrReader& reader, const std::filesystem::path& file);
/// The same for one file, by a reader of its own.
FrameQuality read_frame_quality(const std::filesystem::path& file);

/// The contents of an EXR file that a preview needs.
struct ExrImage {
  int width = 0, height = 0;  ///< of the display window
  std::vector<float> rgba;    ///< premultiplied; 0 outside the data window
  int fps_numerator = 24, fps_denominator = 1;
  std::string time_code = {};  ///< "HH:MM:SS:FF"; empty if the file has none
  std::string color_interop_id = {}, color_space = {};  ///< see ExrChannelData
  bool is_equirectangular = false;
};

/// Reads R, G, B and A (1 if it is missing) of the first part of a flat EXR within its display
/// window; of a view, e.g. "right", if one is named. Throws Error (bad input) if the file is
/// missing, damaged or no EXR, or lacks the view.
ExrImage read_exr(const images::ExrReader& reader, const std::filesystem::path& file,
                  const std::string& view = {});
/// The same for one file, by a reader of its own.
ExrImage read_exr(const std::filesystem::path& file, const std::string& view = {});

}  // namespace raystage::compose
