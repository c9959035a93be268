// SPDX-License-Identifier: Apache-2.0
#include "store/recorder_restarts.h"

#include <algorithm>
#include <filesystem>

#include "schemas/recording_document.h"

namespace raystage {

std::vector<std::vector<Nanoseconds>> recorder_restarts(const Take& take) {
  std::vector<std::vector<Nanoseconds>> starts(static_cast<std::size_t>(take.camera_count()));
  std::error_code none;
  for (const auto& file : std::filesystem::directory_iterator(take.folder() / "recording", none)) {
    if (file.path().extension() != ".json") continue;
    for (const auto& session : read_recording(file.path()).sessions) {
      for (const auto& camera : session.cameras) {
        const int index = take.camera_index(camera.id);
        if (index < 0) continue;
        starts[static_cast<std::size_t>(index)].push_back(session.started_utc -
                                                          take.document().epoch_utc);
      }
    }
  }
  for (std::vector<Nanoseconds>& times : starts) {
    std::ranges::sort(times);
    if (!times.empty()) times.erase(times.begin());
  }
  return starts;
}

}  // namespace raystage
