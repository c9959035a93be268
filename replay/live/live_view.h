// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stop_token>
#include <vector>

#include "replay/live/live_take.h"
#include "replay/source_answers.h"
#include "schemas/viewer_message.h"

namespace raystage::replay {

/// Shows the newest instant of a take that is being recorded: all cameras as a mosaic, and a
/// virtual view by `focal_plane`. The process has the lowest priority from then on. Not
/// thread-safe.
class LiveView {
 public:
  /// Throws Error (bad input) if the folder is not a take.
  explicit LiveView(std::filesystem::path folder);

  const std::filesystem::path& folder() const { return folder_; }
  /// Answers a message of the type kLive: the mosaic with the recording's status, and the view from
  /// the request's camera, or else from the middle of the array. Before the first instant the
  /// mosaic is empty and there is no view. Throws Cancelled.
  std::vector<SourceAnswer> update(const schemas::ViewerMessage& request,
                                   const std::stop_token& stop);

 private:
  std::filesystem::path folder_;
  LiveTake take_;
};

}  // namespace raystage::replay
