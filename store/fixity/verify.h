// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "store/fixity/verify_archive.h"
#include "store/take.h"

namespace raystage::store {

/// The frames of a camera, from the first one, that were checked and are intact.
struct CheckedFrames {
  std::int64_t frames = 0;
  bool is_complete = false;  ///< all of them, and everything else in archive and journal
};

/// Settings of verify_take(). Files are mapped and read once, cameras in parallel.
struct TakeVerifyOptions {
  VerifyDepth depth = VerifyDepth::kHashes;
  bool decode = false;                   ///< also decode every JPEG; implies kHashes
  std::function<void(double)> progress;  ///< called with the share done, 0 to 1, from any thread
  /// By camera, what an earlier check of the same files found: it is not read again. May be empty.
  std::vector<CheckedFrames> checked;
  /// Called from any thread with a camera that has no problem so far, for `checked` of a later
  /// check.
  std::function<void(int, const CheckedFrames&)> on_checked;
  /// Called from any thread before so many bytes of frames are read, e.g. to wait.
  std::function<void(std::uint64_t)> before_read;
  /// Whether the page cache is left as it was: archives that were not in it are dropped again.
  bool spares_page_cache = false;
  std::stop_token stop;
};

/// The problems of a take, with file names relative to its folder.
struct TakeFixityReport {
  struct Camera {
    std::string id;
    std::uint64_t bytes = 0;  ///< of archive and journal together
    ArchiveFixityReport report;
    /// Intact frames of video that refer to damaged or lost ones and cannot be decoded, at depth
    /// kHashes without `decode`. No problem of their own: after a repair they are as recorded.
    std::vector<AffectedFrame> undecodable_frames;
    std::string error;  ///< why the files cannot be verified; empty if they can
  };
  std::vector<Camera> cameras;
  std::vector<FixityProblem> problems;  ///< of the take itself
  double seconds = 0;                   ///< wall time
  RunStatus status = RunStatus::kNotRun;

  std::uint64_t bytes() const;
  bool is_intact() const;    ///< whether there is no problem
  bool is_readable() const;  ///< whether no camera has an error
};

/// Verifies a take. Throws Error (bad input) if take.json or rig.json cannot be read.
TakeFixityReport verify_take(const std::filesystem::path& folder, const TakeVerifyOptions& given);

/// Returns the archive and journal of a camera as the documents describe and name them.
ArchivePair describe_pair(const Take& take, int camera);

}  // namespace raystage::store
