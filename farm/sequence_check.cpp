// SPDX-License-Identifier: Apache-2.0
#include "farm/sequence_check.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <system_error>
#include <thread>

#include "compose/exr/file.h"
#include "schemas/parallel.h"

namespace raystage::farm {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kBetweenLooks{500};

/// ENOENT and ESTALE pass with time on a network file system; a damaged file does not.
bool may_appear(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (status.type() == std::filesystem::file_type::not_found) return true;
  return error.value() == ESTALE;
}

/// Asks the server for the folder's entries: a client may remember that a name was not there.
void look_again(const std::filesystem::path& folder) {
  std::error_code ignored;
  const std::filesystem::directory_iterator entries(folder, ignored);
  static_cast<void>(entries);
}

}  // namespace

std::vector<int> missing_frames(const SequenceName& name, std::span<const ExpectedFrame> frames,
                                const CheckSettings& settings, const std::stop_token& stop) {
  const SequenceName deep = name.with("deep");
  const Clock::time_point start = Clock::now();
  const auto time_left = [&] {
    return std::chrono::duration<double>(Clock::now() - start).count() < settings.patience_seconds;
  };
  std::vector<char> is_missing(frames.size(), 0);
  std::atomic<std::size_t> done = 0;
  const auto check = [&](std::size_t i) {
    const auto is_whole = [&](const std::filesystem::path& file) {
      return exr_is_whole(file, frames[i].fingerprint);
    };
    while (!stop.stop_requested()) {
      const std::filesystem::path file = name.path(frames[i].frame);
      const std::filesystem::path deep_file = deep.path(frames[i].frame);
      const bool whole = is_whole(file);
      if (whole && (!settings.deep || is_whole(deep_file))) return true;
      if (!may_appear(whole ? deep_file : file) || !time_left()) return false;
      std::this_thread::sleep_for(kBetweenLooks);
      look_again(name.folder());
    }
    return false;
  };
  raystage::parallel_for(std::size_t{0}, frames.size(), [&](std::size_t i) {
    is_missing[i] = check(i) ? 0 : 1;
    settings.progress(static_cast<double>(++done) / static_cast<double>(frames.size()));
  });
  std::vector<int> missing;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (is_missing[i] != 0) missing.push_back(frames[i].frame);
  }
  std::ranges::sort(missing);
  return missing;
}

}  // namespace raystage::farm
