// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "base/time.h"
#include "store/take.h"
#include "store/temporal/video_encoder.h"

namespace raystage::store {

/// Which frames a frame may be predicted from.
enum class References {
  kTime,    ///< earlier ones of its camera
  kCameras  ///< those of the cameras before it in serpentine order, of its instant
};

/// How the frames of a take are encoded as video.
struct TemporalOptions {
  VideoSettings video;
  References references = References::kTime;
  int frames_at_once = 512;  ///< of a camera, about, that are encoded before they are written
  std::function<void(double)> progress;  ///< called with the share done, 0 to 1
  std::stop_token stop;
};

/// What encoding a take has done.
struct TemporalReport {
  struct Camera {
    std::string id;
    std::int64_t frames = 0;         ///< stored
    std::int64_t groups = 0;         ///< that begin with a frame of the camera
    std::int64_t frames_in_444 = 0;  ///< encoded in 4:4:4; the others in 4:2:0
    std::uint64_t bytes_before = 0;  ///< of the frames, as stored in the source
    std::uint64_t bytes_after = 0;   ///< of the frames, as stored in the new take
    /// Of the decoded pictures against the source's Y'CbCr samples in the same chroma sampling,
    /// mean square error over all samples of a frame, full scale 255. 0 and infinity of no frames.
    double mean_square_error = 0, min_psnr_db = 0;
  };
  std::vector<Camera> cameras;
  double seconds = 0;  ///< wall time of the frames
  /// Of encoding and of decoding and comparing, summed over the threads, s.
  double encode_thread_seconds = 0, decode_thread_seconds = 0;
  RunStatus status = RunStatus::kNotRun;

  Camera total() const;    ///< without an id
  double psnr_db() const;  ///< of the mean square error over all frames
};

/// Writes a take with the same records whose frames are encoded as video, lossy. Each group is
/// decoded again as readers do, and compared. Times, gaps and their reasons are those of the
/// source; all its other files are copied, but hidden ones and depth/; its manifest becomes
/// original/manifest.sha256. The source is not modified; the new take gets its name when it is
/// complete. Memory: an encoder and `frames_at_once` encoded frames, or those of an instant, per
/// thread.
/// Throws as pack_take(), and Error (bad input) if the take is temporal already or a frame is
/// damaged.
TemporalReport pack_temporal(const Take& take, const std::filesystem::path& folder,
                             const TemporalOptions& options);

/// Frames of a take for a measurement.
struct Excerpt {
  Nanoseconds first = 0, last = 0;          ///< since the take's epoch; frames at both are included
  std::optional<VideoSettings> video;       ///< nullopt: frames as they are read from the take
  std::vector<int> unencoded_cameras = {};  ///< whose frames are as read in any case
  References references = References::kTime;
  int frames_at_once = TemporalOptions{}.frames_at_once;
};

/// Throws Error (bad input) if a new take cannot be made of a take there: `folder` exists or is
/// within the take, or the take has files that cannot be copied. pack_temporal() calls this, too.
void require_new_take(const Take& take, const std::filesystem::path& folder);

/// Writes a take of the frames of some time only, as readers get them after encoding: JPEG. It has
/// no other files but the documents. Throws as pack_temporal().
void write_excerpt(const Take& take, const std::filesystem::path& folder, const Excerpt& excerpt,
                   const std::stop_token& stop);

}  // namespace raystage::store
