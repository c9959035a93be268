// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "store/archive.h"
#include "store/fixity/verify_archive.h"
#include "store/journal.h"
#include "store/jpeg/decode.h"
#include "store/jpegxl/frame_packer.h"
#include "store/jpegxl/picture_codec.h"
#include "store/matroska.h"
#include "store/temporal/group_decoder.h"

namespace raystage::store {

/// A stored frame of an archive and the place of its record in the journal.
struct JournaledFrame {
  FrameRecord record;
  std::size_t slot = 0;  ///< offset of the record in the journal, bytes
  std::uint32_t journal_version = journal::kVersion;
};

/// Decodes the frames of one archive in their order, each group of video once.
class DecodedFrameCheck {
 public:
  /// The pair must outlive the check.
  DecodedFrameCheck(const ArchivePair& pair, FrameCodec codec) : pair_(pair), codec_(codec) {}

  /// Tells that a key frame is not checked: the frames of its group that follow need it.
  void skip_key_frame(const JournaledFrame& frame) { skipped_start_ = frame; }
  /// Decodes the stored bytes of a frame. Returns what is wrong with them; nullopt if they decode
  /// to the camera's size, or refer to other cameras (verify_take() decodes those). Throws Error
  /// if the decoder cannot be run.
  std::optional<std::string> problem_of(std::span<const std::byte> stored,
                                        const JournaledFrame& frame);

 private:
  using Bytes = std::span<const std::byte>;
  bool is_as_recorded(const matroska::FoundFrame& frame, std::size_t& slot,
                      std::uint32_t version) const;
  std::vector<std::vector<std::byte>> decode_beginning(std::span<const Bytes> frames);
  std::vector<std::byte> decode_temporal(const JournaledFrame& frame, std::uint32_t position);

  const ArchivePair& pair_;
  FrameCodec codec_;
  JpegDecoder decoder_;
  FramePacker packer_;
  PictureCodec pictures_;
  GroupDecoder groups_;
  std::vector<std::vector<std::byte>> group_;  // pictures of the last group, until each was checked
  std::optional<JournaledFrame> skipped_start_;  // of the group in which an earlier run ended
};

}  // namespace raystage::store
