// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <stop_token>
#include <vector>

#include "store/packing/camera_order.h"
#include "store/take.h"
#include "store/temporal/group_decoder.h"
#include "store/temporal/video_encoder.h"

namespace raystage::store {

/// Frames that are encoded one after the other as video: of one camera, or of an instant.
struct Sequence {
  std::vector<FrameRef> frames;
  std::vector<std::vector<std::byte>> stored;   ///< temporal frames; empty: not encoded
  std::vector<std::vector<std::byte>> decoded;  ///< JPEGs as readers get them, if they are kept
  std::vector<double> errors;                   ///< mean square error of each, full scale 255
  ChromaStep chroma = ChromaStep::k420;         ///< of the encoded pictures
};

/// Encodes sequences of a take's frames, decodes their groups again as readers do, and compares the
/// pictures with their sources. Thread-safe.
class SequenceEncoder {
 public:
  /// `folder`: of the new take, for errors. `keeps_decoded`: fills in Sequence::decoded.
  SequenceEncoder(const Take& take, std::filesystem::path folder, const VideoSettings& video,
                  bool keeps_decoded, std::stop_token stop);

  /// Fills in the results of `sequence`, whose frames are of one size, in 4:4:4 if the first is and
  /// the encoder takes it. Throws Error (failed) if it
  /// is stopped or an encoder fails, and Error (bad input) if a frame is damaged.
  void encode(Sequence& sequence) const;

  /// Of encoding and of decoding and comparing, summed over the threads, s.
  double encode_thread_seconds() const { return static_cast<double>(encode_us_) / 1e6; }
  double decode_thread_seconds() const { return static_cast<double>(decode_us_) / 1e6; }

 private:
  void require_not_stopped() const;
  FrameBytes jpeg_of(const FrameRef& frame) const;
  Planes planes_of(const FrameRef& frame, const FrameBytes& jpeg, ChromaStep chroma) const;
  void make_frames(Sequence& sequence) const;
  void compare(Sequence& sequence) const;

  const Take& take_;
  const std::filesystem::path folder_;
  const VideoSettings video_;
  const bool keeps_decoded_;
  const std::stop_token stop_;
  GroupDecoder decoder_;
  mutable std::atomic<std::int64_t> encode_us_ = 0, decode_us_ = 0;
};

}  // namespace raystage::store
