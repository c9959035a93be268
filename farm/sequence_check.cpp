// SPDX-License-Identifier: Apache-2.0
// Finds incomplete frames. All files are checked in parallel; expected ones that are missing are
// then checked again every 0.5 s until the timeout. Each check requests the folder's entries anew,
// as clients of network file systems cache them. Cost: reading every file once.
#include "farm/sequence_check.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>

#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "compose/exr/exr_file.h"
#include "images/exr_reader.h"

namespace raystage::farm {
namespace {

constexpr std::chrono::milliseconds kBetweenLooks{500};

/// Returns whether a later check may find the file: on a network file system ENOENT and ESTALE may
/// pass with time. A stale handle may show when the file is opened or only when it is read.
bool may_appear(const std::filesystem::path& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) return errno == ENOENT || errno == ESTALE;
  char first = 0;
  const bool is_stale = pread(descriptor, &first, 1, 0) < 0 && errno == ESTALE;
  close(descriptor);
  return is_stale;
}

/// Requests the folder's entries from the server: a client may have cached that a name is missing.
void refresh_folder(const std::filesystem::path& folder) {
  std::error_code ignored;
  const std::filesystem::directory_iterator entries(folder, ignored);
  static_cast<void>(entries);
}

}  // namespace

bool SequenceCheckOptions::is_valid(std::string* reason) const {
  return is_within("timeout (s)", timeout_seconds, 0, 1e9, reason);
}

std::vector<int> missing_frames(const compose::SequenceName& name,
                                std::span<const ExpectedFrame> frames,
                                const SequenceCheckOptions& options, const std::stop_token& stop) {
  require_valid(options, "check of a sequence");
  const compose::SequenceName deep = name.with("deep");
  std::vector<char> is_missing(frames.size(), 0);
  const images::ExrReader reader;
  const auto is_whole = [&](const ExpectedFrame& frame) {
    return compose::find_complete_exr(reader, name.path(frame.frame), frame.fingerprint) &&
           (!options.deep ||
            compose::find_complete_exr(reader, deep.path(frame.frame), frame.fingerprint));
  };
  const auto may_come = [&](const ExpectedFrame& frame) {
    return may_appear(name.path(frame.frame)) ||
           (options.deep && may_appear(deep.path(frame.frame)));
  };
  std::atomic<std::size_t> done = 0;
  raystage::parallel_for(std::size_t{0}, frames.size(), [&](std::size_t i) {
    is_missing[i] = stop.stop_requested() || is_whole(frames[i]) ? 0 : 1;
    options.progress(static_cast<double>(++done) / frames.size());
  });
  // The timeout starts after the first check, however long that took.
  const Stopwatch watch;
  const auto is_expected_on_disk = [&](std::size_t i) {
    return is_missing[i] != 0 && frames[i].is_expected_on_disk && may_come(frames[i]);
  };
  while (watch.seconds() < options.timeout_seconds && !stop.stop_requested()) {
    bool any = false;
    for (std::size_t i = 0; i < frames.size(); ++i) any = any || is_expected_on_disk(i);
    if (!any) break;
    std::this_thread::sleep_for(kBetweenLooks);
    refresh_folder(name.folder());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (is_missing[i] != 0 && is_whole(frames[i])) is_missing[i] = 0;
    }
  }
  std::vector<int> missing;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (is_missing[i] != 0) missing.push_back(frames[i].frame);
  }
  std::ranges::sort(missing);
  return missing;
}

ShortFrames short_frames(const compose::SequenceName& name, std::span<const int> frames,
                         double least_share, double timeout_seconds, const std::stop_token& stop) {
  const Stopwatch watch;
  const images::ExrReader reader;
  const auto quality_of = [&](int frame) {
    while (!stop.stop_requested()) {
      try {
        return compose::read_frame_quality(reader, name.path(frame));
      } catch (const Error&) {  // a stale handle of a network file system
        if (watch.seconds() > timeout_seconds) break;
        std::this_thread::sleep_for(kBetweenLooks);
      }
    }
    return compose::FrameQuality{0, {}};
  };
  std::vector<compose::FrameQuality> qualities(frames.size());
  raystage::parallel_for(std::size_t{0}, frames.size(),
                         [&](std::size_t i) { qualities[i] = quality_of(frames[i]); });
  ShortFrames found;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (least_share > 0 && qualities[i].covered_share < least_share)
      found.below_coverage.push_back(frames[i]);
    if (!qualities[i].rotten_cameras.empty()) found.with_rot.push_back(frames[i]);
  }
  std::ranges::sort(found.below_coverage);
  std::ranges::sort(found.with_rot);
  return found;
}

}  // namespace raystage::farm
