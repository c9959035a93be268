// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "store/take.h"

namespace raystage::store {

/// How a take is packed or unpacked.
struct PackOptions {
  /// libjxl's effort, 1 to 9: more takes longer and saves more.
  int effort = 7;
  std::function<void(double)> progress;  ///< called with the share done, 0 to 1
  std::stop_token stop;
};

/// What packing or unpacking has done.
struct PackReport {
  struct Camera {
    std::string id;
    std::int64_t frames = 0;         ///< stored
    std::int64_t packed = 0;         ///< of them, packed in the packed take
    std::uint64_t bytes_before = 0;  ///< of the frames, as stored in the source
    std::uint64_t bytes_after = 0;   ///< of the frames, as stored in the new take
    /// Why frames stay as they are, and how many.
    std::map<std::string, std::int64_t> refusals;
  };
  std::vector<Camera> cameras;
  double seconds = 0;  ///< wall time of the frames
  /// Time of reading, packing or unpacking and comparing frames, summed over the threads, s.
  double thread_seconds = 0;
  RunStatus status = RunStatus::kNotRun;

  Camera total() const;  ///< without an id
};

/// Writes a take with the same records, frames packed. A frame counts as packed only after it was
/// unpacked and compared; others stay JPEG. All other files of the take are copied, but hidden ones
/// and depth/; its manifest becomes original/manifest.sha256. The source is not modified; the new
/// take gets its name when it is complete. Memory: frames of up to 128 MiB, and at most one per
/// thread more. Throws RottenFrame if a frame is not as recorded, Error (bad input) if an archive
/// is not closed or is damaged, or `folder` exists, and Error (failed) if the disk fails or it was
/// stopped.
PackReport pack_take(const Take& take, const std::filesystem::path& folder,
                     const PackOptions& options);

/// Writes the take that was packed: every frame as JPEG, bit for bit, and its manifest under its
/// own name again. Throws as pack_take(), and Error (bad input) if no archive is packed.
PackReport unpack_take(const Take& take, const std::filesystem::path& folder,
                       const PackOptions& options);

}  // namespace raystage::store
