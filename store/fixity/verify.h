// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "store/fixity/verify_archive.h"
#include "store/take.h"

namespace raystage {

/// How a take is verified; files are mapped and read once, cameras in parallel.
struct TakeVerifyOptions {
  VerifyDepth depth = VerifyDepth::kHashes;
  bool decode = false;  ///< every JPEG too; looks as closely as kHashes, whatever `depth` says
  std::function<void(double)> progress;  ///< called with the share done, 0 to 1, from any thread
  std::stop_token stop;
};

/// What there is to say about a take; problems name files relative to its folder.
struct TakeReport {
  struct Camera {
    std::string id;
    std::uint64_t bytes = 0;  ///< of archive and journal together
    ArchiveReport report;
    std::string error;  ///< why the files cannot be judged at all; empty when they can
  };
  std::vector<Camera> cameras;
  std::vector<Problem> problems;  ///< of the take as such
  double seconds = 0;             ///< wall time
  bool stopped = false;           ///< by options.stop: the report is not complete

  std::uint64_t bytes() const;
  bool whole() const;     ///< nothing was found
  bool readable() const;  ///< no camera has an error
};

/// Throws Error (bad input) where take.json or rig.json cannot be read.
TakeReport verify_take(const std::filesystem::path& folder, const TakeVerifyOptions& given);

/// The archive and journal of a camera as the documents describe them, under their names there.
ArchivePair describe_pair(const Take& take, int camera);

}  // namespace raystage
