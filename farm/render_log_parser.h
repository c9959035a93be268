// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "schemas/farm_records.h"

namespace raystage::farm {

/// What the log of `raystage render` or `raystage prepare` says next to its progress, line by line.
class RenderLogParser {
 public:
  void parse_line(std::string_view line);
  /// Of a command that failed: the first failed frame that it reported, else why it ended as it
  /// says itself, else its last line.
  std::string reason() const {
    return !first_failure.empty() ? first_failure : !error_message.empty() ? error_message : last;
  }

  int solved = 0, read = 0;  ///< light field frames, by their depths
  std::string last, first_failure, error_message;
  std::set<int> failed_frames;
  std::optional<RenderStageCosts> rendering;
};

}  // namespace raystage::farm
