// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "compose/sequence_name.h"

namespace raystage::farm {

/// A frame and the fingerprint that its file must have.
struct ExpectedFrame {
  int frame = 0;
  std::string fingerprint;
  bool is_expected_on_disk = true;  ///< its task reported success: the file may still appear
};

struct SequenceCheckOptions {
  bool deep = false;  ///< check the deep files, too
  /// Limit of the wait for an expected frame that is missing or whose handle is stale. The file of
  /// another host may appear late on a network file system. Measured by this process' steady clock,
  /// never by times of files.
  double timeout_seconds = 60;
  std::function<void(double)> progress = [](double) {};
  bool is_valid(std::string* reason) const;
};

/// Returns the frames that are incomplete (a pixel of a part is missing) or have another
/// fingerprint, sorted. Only reads files.
std::vector<int> missing_frames(const compose::SequenceName& name,
                                std::span<const ExpectedFrame> frames,
                                const SequenceCheckOptions& options, const std::stop_token& stop);

/// Frames that are complete, but fall short; each sorted.
struct ShortFrames {
  std::vector<int> below_coverage;  ///< cameras see less than the least share of the view
  std::vector<int> with_rot;        ///< cameras with rotten frames are absent
};

/// Returns the frames that fall short, as their files state. A file that cannot be read is read
/// again until the timeout, and then counts as below the least share.
ShortFrames short_frames(const compose::SequenceName& name, std::span<const int> frames,
                         double least_share, double timeout_seconds, const std::stop_token& stop);

}  // namespace raystage::farm
