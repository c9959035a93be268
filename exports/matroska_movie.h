// SPDX-License-Identifier: Apache-2.0
// Matroska files with any number of video tracks and times in nanoseconds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/time.h"

namespace raystage::exports {

struct MatroskaTrack {
  std::string name;                           ///< shown by players: the camera's id
  int width = 0, height = 0;                  ///< pixels
  std::string codec_id = "V_MJPEG";           ///< as Matroska's codec specifications
  std::vector<std::byte> codec_private = {};  ///< as the codec's specification; may be empty
  Nanoseconds default_duration = 0;           ///< of a frame; 0: unknown
};

/// A file that is stored within the movie.
struct MatroskaAttachment {
  std::string name, media_type, contents;
};

struct MatroskaDescription {
  std::string title;
  Nanoseconds epoch_utc = 0;  ///< of time 0, since 1970 (DateUTC)
  std::vector<MatroskaTrack> tracks;
  std::vector<MatroskaAttachment> attachments = {};
};

/// Writes a Matroska file (RFC 9559): time-stamp scale 1 ns, every frame a key frame. Blocks within
/// 32767 ns share a cluster, because a block's time is 16 bits relative to its cluster. The file
/// has a temporary name until close(). Holds the frames of one cluster in memory.
class MatroskaMovie {
 public:
  /// Largest number of tracks, and the largest time: 2^53 ns, 104 days. FFmpeg converts times to
  /// double and rounds larger ones.
  static constexpr std::size_t kMaxTracks = 4096;
  static constexpr Nanoseconds kMaxTime = Nanoseconds{1} << 53;

  /// Throws Error (bad input) for no track or more than kMaxTracks, Error (failed) if the file
  /// cannot be created.
  MatroskaMovie(const std::filesystem::path& file, MatroskaDescription description);
  ~MatroskaMovie();  ///< removes the file unless it was closed
  MatroskaMovie(const MatroskaMovie&) = delete;
  MatroskaMovie& operator=(const MatroskaMovie&) = delete;

  /// Appends a frame. Times must not decrease over all tracks. Throws Error (bad input) for a time
  /// outside of [0, kMaxTime] or before the last one, Error (failed) if the disk fails.
  void append(int track, Nanoseconds time, std::span<const std::byte> frame);
  /// Writes cues, duration and sizes, and gives the file its name.
  void close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::exports
