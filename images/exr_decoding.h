// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string>

#include "images/exr_channels.h"
#include "images/exr_inspection.h"

namespace raystage::images {

/// What ExrReader does, in the decoder's process. On damaged files anything may happen.
ExrChannelData decode_exr_channels(const std::filesystem::path& file,
                                   std::span<const ExrChannel> channels,
                                   const std::string& what_to_do);
ExrChannelData decode_exr_view(const std::filesystem::path& file, const std::string& view,
                               std::span<const ExrChannel> channels, const std::string& what_to_do);
std::array<int, 2> decode_exr_size(const std::filesystem::path& file,
                                   std::span<const ExrChannel> channels,
                                   const std::string& what_to_do);
ExrInspection decode_exr_inspection(const std::filesystem::path& file);
bool decode_has_channels(const std::filesystem::path& file, std::span<const ExrChannel> channels,
                         const std::string& view);

}  // namespace raystage::images
