// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace raystage::images {

/// A channel to read.
struct ExrChannel {
  const char* name = "";
  /// Value if the channel is absent; nullopt: required.
  std::optional<float> fallback = std::nullopt;
};

/// The channels and attributes read from a file.
struct ExrChannelData {
  int width = 0, height = 0;  ///< of the display window
  std::vector<float> values;  ///< interleaved: row by row, pixel by pixel, one value per channel
  /// Frame rate of the header; 0 if it has none above 0.
  int fps_numerator = 0, fps_denominator = 0;
  std::string time_code;  ///< of the header, "HH:MM:SS:FF"; empty if absent
  /// Attributes `colorInteropID` (ASWF ColorInterop) and `lf:colorSpace` (config's name), or empty.
  std::string color_interop_id, color_space;
  /// Attribute `chromaticities`: CIE x, y of red, green, blue and white; nullopt: absent.
  std::optional<std::array<float, 8>> chromaticities = std::nullopt;
  bool is_equirectangular = false;  ///< attribute `envmap`: longitude by latitude
};

}  // namespace raystage::images
