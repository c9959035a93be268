// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
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
  bool is_equirectangular = false;  ///< attribute `envmap`: longitude by latitude
};

/// Reads channels from the first flat part of an EXR file that has all required channels or, if
/// none is required, any channel; of the default view where channels' names have views. Covers the
/// display window and is 0 outside the data window. Throws Error (bad input, with `what_to_do`) if
/// the file is missing, damaged, larger than 2^29 pixels, or lacks a required channel.
ExrChannelData read_exr_channels(const std::filesystem::path& file,
                                 std::span<const ExrChannel> channels,
                                 const std::string& what_to_do);

/// As read_exr_channels(), from one view of a file with several ("left", "right"): parts with the
/// attribute `view`, or channels that have the view in their names (`multiView`). Also throws Error
/// (bad input) if the file lacks the view.
ExrChannelData read_exr_view(const std::filesystem::path& file, const std::string& view,
                             std::span<const ExrChannel> channels, const std::string& what_to_do);

/// Checks from the headers only that read_exr_channels() finds the required channels. Returns the
/// display window's width and height. Throws the same Errors.
std::array<int, 2> check_exr_channels(const std::filesystem::path& file,
                                      std::span<const ExrChannel> channels,
                                      const std::string& what_to_do);

/// Returns whether a part of the file, or the view if one is named, has all required channels.
/// Throws Error (bad input) if the file is missing or damaged.
bool has_exr_channels(const std::filesystem::path& file, std::span<const ExrChannel> channels,
                      const std::string& view = {});

}  // namespace raystage::images
