// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace raystage {

/// A channel to read.
struct ExrChannel {
  const char* name = "";
  std::optional<float> fallback = std::nullopt;  ///< where the file has none; nullopt: it must
};

/// What was read of a file.
struct ExrChannelData {
  int width = 0, height = 0;  ///< of the display window
  std::vector<float> values;  ///< of the channels in turn, pixel by pixel, row by row
  /// Of the header, where it says a rate above 0.
  int fps_numerator = 0, fps_denominator = 0;
  std::string time_code;  ///< of the header, "HH:MM:SS:FF"; empty where it has none
  /// Its attributes `colorInteropID` (ASWF ColorInterop) and `lf:colorSpace`, a config's name;
  /// empty where it has none.
  std::string color_interop_id, color_space;
};

/// Reads channels of the first flat part of an EXR that has those that it must have, or if it must
/// have none, any of them, within its display window; where
/// the data window ends, they are 0. Throws Error (bad input, with `what_to_do`) where the file is
/// missing, damaged, larger than 2^29 pixels, or without a channel that it must have.
ExrChannelData read_exr_channels(const std::filesystem::path& file,
                                 std::span<const ExrChannel> channels,
                                 const std::string& what_to_do);

/// Whether read_exr_channels() finds what it must: reads the headers alone. Returns the display
/// window's width and height. Throws Error likewise.
std::array<int, 2> check_exr_channels(const std::filesystem::path& file,
                                      std::span<const ExrChannel> channels,
                                      const std::string& what_to_do);

}  // namespace raystage
