// SPDX-License-Identifier: Apache-2.0
#include "store/archive.h"
#include "store/temporal/temporal_frame.h"

namespace raystage::store {

bool refers_to_cameras(FrameCodec codec) {
  return codec == FrameCodec::kHevcCameras || codec == FrameCodec::kAv1Cameras;
}

bool is_temporal(FrameCodec codec) {
  return codec == FrameCodec::kHevc || codec == FrameCodec::kAv1 || refers_to_cameras(codec);
}

VideoCodec video_codec_of(FrameCodec codec) {
  const bool is_hevc = codec == FrameCodec::kHevc || codec == FrameCodec::kHevcCameras;
  return is_hevc ? VideoCodec::kHevc : VideoCodec::kAv1;
}

}  // namespace raystage::store
