// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include "replay/live/live_take.h"
#include "replay/source_answers.h"
#include "schemas/viewer_message.h"

namespace raystage::replay {

/// Shows the newest instant of a take that is being recorded: all cameras as a mosaic, or a
/// virtual view by `focal_plane`. The process has the lowest priority from then on. Not
/// thread-safe.
class LiveView {
 public:
  /// Throws Error (bad input) if the folder is not a take.
  explicit LiveView(std::filesystem::path folder);

  const std::filesystem::path& folder() const { return folder_; }
  /// Reads what was appended, and returns how the recording goes on.
  const LiveStatus& update();
  /// Returns the picture for a message of the type kLive at the last update: the mosaic, or the
  /// view from the request's camera or else from the middle of the array; nullopt before the first
  /// instant. Throws Cancelled, and Error (bad input) for a frame that cannot be read.
  std::optional<SourceAnswer> picture(const schemas::ViewerMessage& request,
                                      const std::stop_token& stop) const;

 private:
  std::filesystem::path folder_;
  LiveTake take_;
};

}  // namespace raystage::replay
