// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "store/temporal/planes.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {

/// How a sequence of pictures is encoded.
struct VideoSettings {
  VideoCodec codec = VideoCodec::kAv1;
  /// Constant rate factor, 0 to 51 (HEVC) or 1 to 63 (AV1): larger is smaller and worse.
  double crf = 30;
  int group_frames = 12;  ///< from key frame to key frame; 1: every frame is one
};
/// Returns the largest rate factor of a codec.
double max_crf(VideoCodec codec);
/// Returns the least one, of the best pictures; AV1 takes whole numbers only.
double min_crf(VideoCodec codec);

/// One encoded picture.
struct VideoPacket {
  bool is_key = false;  ///< the first of a group
  std::vector<std::byte> bytes;
};

/// Returns whether the encoder of a codec takes 4:4:4. SVT-AV1 does not.
inline bool can_encode_444(VideoCodec codec) { return codec == VideoCodec::kHevc; }

/// Encodes pictures through FFmpeg, HEVC by x265 and AV1 by SVT-AV1: 8 bits, full range, one packet
/// for each picture in order, groups that do not depend on each other.
class VideoEncoder {
 public:
  explicit VideoEncoder(const VideoSettings& settings);
  ~VideoEncoder();
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;

  /// Encodes the next picture, of the size and chroma sampling of the first. Throws Error (failed)
  /// if FFmpeg lacks the encoder or does not accept the settings.
  void push(const Planes& picture);
  /// Returns the packets of all pictures, in order. Call once, last. Throws Error (failed).
  std::vector<VideoPacket> finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Makes encoders print no messages. Call before threads start.
void silence_encoders();

}  // namespace raystage::store
