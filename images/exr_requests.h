// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "images/exr_channels.h"
#include "images/exr_inspection.h"
#include "sandbox/byte_encoding.h"

namespace raystage::images {

/// What raystage-decode-exr is asked for.
enum class ExrQuestion : std::uint8_t {
  kChannels,     ///< result: ExrChannelData
  kView,         ///< result: ExrChannelData
  kSize,         ///< result: width and height
  kHasChannels,  ///< result: a flag
  kInspection    ///< result: ExrInspection
};

struct ExrRequest {
  ExrQuestion question{};
  std::string file, view, what_to_do;
  std::vector<std::string> names;  ///< of the channels
  std::vector<float> fallbacks;    ///< for each; not-a-number: it is required
};
void write_request(sandbox::ByteWriter& writer, const ExrRequest& request);
ExrRequest read_request(sandbox::ByteReader& reader);

void write_channel_data(sandbox::ByteWriter& writer, const ExrChannelData& data);
/// `channels`: number of those that were asked for. Throws std::runtime_error if the data are not
/// those of an image.
ExrChannelData read_channel_data(sandbox::ByteReader& reader, std::size_t channels);

void write_inspection(sandbox::ByteWriter& writer, const ExrInspection& inspection);
/// Throws std::runtime_error if the data are damaged.
ExrInspection read_inspection(sandbox::ByteReader& reader);

}  // namespace raystage::images
