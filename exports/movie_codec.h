// SPDX-License-Identifier: Apache-2.0
// How the pictures of exported movies are stored.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/frame_rate.h"
#include "base/time.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::exports {

struct MovieDescription {
  std::string name;           ///< of the track: the camera's id
  int width = 0, height = 0;  ///< pixels
  Nanoseconds epoch_utc = 0;  ///< of time 0, since 1970
  /// Frames are at n / rate; none: at any times.
  std::optional<FrameRate> rate = {};
  /// Duration of a single frame, where there is no rate, ns.
  Nanoseconds typical_duration = 0;
};

/// Writes one movie. The file has a temporary name until close(); the destructor removes it unless
/// it was closed.
class MovieFile {
 public:
  virtual ~MovieFile() = default;
  /// Appends a frame at an increasing time, ns. `jpeg`: of the frame; `picture`: decoded from it,
  /// null if MovieCodec::copies_jpeg(). Throws Error (failed) if it cannot be encoded or written.
  virtual void append(std::span<const std::byte> jpeg, const store::RgbImage* picture,
                      Nanoseconds time) = 0;
  virtual void close() = 0;
};

/// A codec of movies with the containers that it is written to. To add one: a class in
/// movie_codecs.cpp and a line in movie_codecs().
class MovieCodec {
 public:
  virtual ~MovieCodec() = default;
  /// Returns the name by which users choose it.
  virtual std::string_view name() const = 0;
  /// Returns what the help says: "the JPEG frames as they are, ...".
  virtual std::string_view description() const = 0;
  /// Returns the extensions of its containers, the default first: ".mov".
  virtual std::vector<std::string> extensions() const = 0;
  /// Returns whether it stores the JPEG bytes of frames, so that they are not decoded.
  virtual bool copies_jpeg() const { return false; }
  /// Returns whether frames may be at any times.
  virtual bool has_exact_times() const { return true; }
  /// Returns the bytes that a movie of `frames` frames needs at most, roughly. `source_bytes`: of
  /// the JPEG frames.
  virtual double estimated_bytes(double source_bytes, double pixels) const = 0;
  /// Creates a movie. Throws Error (bad input) for a container that the codec does not have, and
  /// Error (failed) if the file cannot be created.
  virtual std::unique_ptr<MovieFile> create(const std::filesystem::path& file,
                                            const MovieDescription& description) const = 0;
};

/// Returns all codecs; they live until the program ends.
std::span<const MovieCodec* const> movie_codecs();
/// Returns the codec of this name. Throws std::logic_error if there is none.
const MovieCodec& movie_codec(std::string_view name);
/// Returns the file's extension if the codec has it. Throws Error (bad input), which lists the
/// extensions, otherwise.
std::string movie_extension(const MovieCodec& codec, const std::filesystem::path& file);

}  // namespace raystage::exports
