// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "base/frame_rate.h"

namespace raystage::compose {

/// Frame rate of a glTF file, which counts time in seconds. Times of keys that differ from those of
/// frames by the rounding of floats only are corrected.
struct GltfFrameRate {
  std::optional<FrameRate> stated = {};  ///< instead of that which the file states
  FrameRate otherwise = {};              ///< if none is stated
};

/// What is known about the frames of a glTF file.
struct GltfTiming {
  /// The frame rate, and whether it is stated: by the reader, or by `extras` of the file's `asset`.
  FrameRate frame_rate;
  bool is_rate_stated = false;
  std::optional<int> first_frame;  ///< of the first key, if the file states it
};

/// Converts frames of a shot to times of a glTF file.
struct GltfFrames {
  double fps = 24;
  double zero = 0;  ///< frame of the file's time 0

  double seconds(double frame) const { return (frame - zero) / fps; }
  /// Returns the frame of a key, without the rounding of floats.
  double frame(double seconds) const;
};

/// Returns whether times are those of frames at this rate, but for the rounding of floats.
bool are_at_frames(std::span<const double> seconds, double fps);

/// Returns the frames of a file. A rate that is not stated is that of the shot or, for 24000/1001
/// and the like, 24 if its frames are nearer to the keys: Blender's exporter ignores the base of
/// its frame rate. `where`: of the file in the shot, and `what_to_do`: how its rate can be stated,
/// for errors. Throws Error (bad input) if the keys are between the frames of both.
GltfFrames gltf_frames(const GltfTiming& timing, std::span<const double> key_seconds,
                       const std::filesystem::path& file, const std::string& where,
                       const std::string& what_to_do);

}  // namespace raystage::compose
