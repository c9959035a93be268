// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "images/exr_channels.h"
#include "images/exr_inspection.h"
#include "sandbox/decoder_pool.h"

namespace raystage::images {

/// Reads EXR files in confined processes, which stay until the reader ends. Thread-safe. All
/// functions throw Error (bad input, with `what_to_do` if the channels are the reason) if the file
/// is missing, damaged, larger than 2^29 pixels or than memory allows, and Error (failed) as
/// sandbox::DecoderProcess does.
class ExrReader {
 public:
  /// `memory_bytes`: that the pixels of a file may need; 0: half of the machine's.
  explicit ExrReader(std::size_t memory_bytes = 0);

  /// Reads channels from the first flat part that has all required channels or, if none is
  /// required, any channel; of the default view where channels' names have views. Covers the
  /// display window and is 0 outside the data window. Throws Error (bad input) if the file lacks a
  /// required channel.
  ExrChannelData read(const std::filesystem::path& file, std::span<const ExrChannel> channels,
                      const std::string& what_to_do) const;
  /// As read(), from one view of a file with several ("left", "right"): parts with the attribute
  /// `view`, or channels that have the view in their names (`multiView`). Also throws Error (bad
  /// input) if the file lacks the view.
  ExrChannelData read_view(const std::filesystem::path& file, const std::string& view,
                           std::span<const ExrChannel> channels,
                           const std::string& what_to_do) const;
  /// Checks from the headers only that read() finds the required channels. Returns the display
  /// window's width and height.
  std::array<int, 2> size(const std::filesystem::path& file, std::span<const ExrChannel> channels,
                          const std::string& what_to_do) const;
  /// Returns whether a part of the file, or the view if one is named, has all required channels.
  bool has_channels(const std::filesystem::path& file, std::span<const ExrChannel> channels,
                    const std::string& view = {}) const;
  /// Returns what a rendered file states of itself; its pixels are read but not decompressed, so
  /// that 512 MiB of memory suffice for any size.
  ExrInspection inspect(const std::filesystem::path& file) const;

 private:
  struct Request;
  std::vector<std::byte> decode(const sandbox::DecoderPool& decoders, const Request& request) const;

  sandbox::DecoderPool decoders_;
  sandbox::DecoderPool inspectors_;  ///< processes for inspect()
};

/// ExrReader::read() for one file, in a process of its own.
ExrChannelData read_exr_channels(const std::filesystem::path& file,
                                 std::span<const ExrChannel> channels,
                                 const std::string& what_to_do);

}  // namespace raystage::images
