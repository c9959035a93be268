// SPDX-License-Identifier: Apache-2.0
// The frames of a camera in the order of the output.
#pragma once

#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/rgb_image.h"
#include "store/take.h"

namespace raystage::exports {

/// Reads the chosen frames of one camera one after the other. Where a stored frame is not as it was
/// recorded it counts as absent: the previous frame stands for it (kHold), or a black one, or none
/// (kGap). Not thread-safe.
class SourceFrames {
 public:
  /// A frame that is ready to be written; valid until the next one is read.
  struct Ready {
    std::span<const std::byte> jpeg;  ///< empty if `deep` is not null
    ChosenFrame frame;
    const store::DeepPicture* deep = nullptr;
  };
  /// What is read of frames of more than 8 bits: a JPEG to look at, or their pictures.
  enum class DeepFrames { kJpeg, kPictures };
  SourceFrames(const store::Take& take, const CameraFrames& frames, AbsentFrames absent,
               DeepFrames deep_frames = DeepFrames::kJpeg);

  /// Returns the next frame, or nullopt at the end.
  std::optional<Ready> next();
  /// Returns the decoded picture of the frame that next() returned. Throws Error (bad input) if it
  /// is damaged or has another size than the camera.
  const store::RgbImage& picture();
  /// Returns what was read so far.
  const ExportReport::Camera& counts() const { return counts_; }

 private:
  bool read(int source);
  bool load(ChosenFrame& frame);

  const store::Take& take_;
  const CameraFrames& frames_;
  AbsentFrames absent_;
  bool has_deep_pictures_;
  std::size_t position_ = 0;
  int loaded_ = -2;   ///< source of bytes_: -1 black, -2 none yet
  int decoded_ = -2;  ///< source of picture_
  std::vector<std::byte> bytes_;
  store::DeepPicture deep_;  ///< instead of bytes_, if has_deep_pictures_
  Nanoseconds loaded_ns_ = 0;
  std::set<int> rotten_;  ///< sources
  store::JpegDecoder decoder_;
  store::RgbImage picture_;
  ExportReport::Camera counts_;
};

}  // namespace raystage::exports
