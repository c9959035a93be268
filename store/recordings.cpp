// SPDX-License-Identifier: Apache-2.0
#include "store/recordings.h"

#include <algorithm>

namespace raystage::store {

std::vector<schemas::RecordingDocument> read_recordings(const std::filesystem::path& take_folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  // Not a range-based for: its increment would throw.
  for (std::filesystem::directory_iterator entry(take_folder / "recording", error), end;
       !error && entry != end; entry.increment(error)) {
    if (entry->path().extension() == ".json") files.push_back(entry->path());
  }
  std::ranges::sort(files);
  std::vector<schemas::RecordingDocument> recordings;
  for (const auto& file : files)
    recordings.push_back(
        schemas::read_recording(ContainedPath{take_folder, "recording" / file.filename()}));
  return recordings;
}

std::vector<std::vector<Nanoseconds>> recorder_restarts(const Take& take) {
  std::vector<std::vector<Nanoseconds>> starts(static_cast<std::size_t>(take.camera_count()));
  const Nanoseconds epoch = take.document().epoch_utc;
  for (const schemas::RecordingDocument& recording : read_recordings(take.folder())) {
    for (const schemas::RecordingDocument::Session& session : recording.sessions) {
      for (const schemas::RecordingDocument::Camera& camera : session.cameras) {
        const int index = take.camera_index(camera.id);
        if (index < 0) continue;
        // A time before or after all frames of a take, as any other one there.
        starts[index].push_back(std::clamp(session.started_utc, epoch - 2 * kMaxArchiveTime,
                                           epoch + 2 * kMaxArchiveTime) -
                                epoch);
      }
    }
  }
  for (std::vector<Nanoseconds>& times : starts) {
    std::ranges::sort(times);
    if (!times.empty()) times.erase(times.begin());
  }
  return starts;
}

}  // namespace raystage::store
