// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "schemas/farm_records.h"

namespace raystage::farm {

/// Parses the log of `raystage render` or `raystage prepare` line by line, progress excepted.
class RenderLogParser {
 public:
  void parse_line(std::string_view line);
  /// Returns why the command failed: the first failed frame that it reported, otherwise its error
  /// message, otherwise its last line.
  std::string reason() const {
    return !first_failure.empty() ? first_failure : !error_message.empty() ? error_message : last;
  }

  /// Returns whether every failure was a rotten frame: another attempt would fail in the same way.
  bool has_only_rot() const { return !rotten_frames.empty() && rotten_frames == failed_frames; }

  int solved = 0, read = 0;  ///< light field frames whose depths were estimated, or read
  std::string last, first_failure, error_message;
  std::set<int> failed_frames;
  std::set<int>
      rotten_frames;  ///< those of `failed_frames` that need a stored frame that is rotten
  std::optional<schemas::RenderStageCosts> rendering;
};

}  // namespace raystage::farm
