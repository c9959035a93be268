// SPDX-License-Identifier: Apache-2.0
#include "farm/attempts.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/number_text.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

/// Size of a record on the disk, padded with spaces, which JSON ignores. It has room for every end
/// with texts of kLongestText bytes, so that an end can overwrite its start on a full disk.
constexpr std::size_t kRecordBytes = 8192;
constexpr std::size_t kLongestText = 1500;

fs::path record_file(const JobFolder& folder, const schemas::FarmAttempt& attempt) {
  return folder.attempts() / (attempt_name(attempt) + ".json");
}

std::string padded(std::string text) {
  if (text.size() < kRecordBytes) text.resize(kRecordBytes, ' ');
  if (text.back() == ' ') text.back() = '\n';
  return text;
}

/// Returns the longest prefix of a frame range that ends before a comma and fits kLongestText.
std::string shortened_range(const std::string& frames) {
  if (frames.size() <= kLongestText) return frames;
  const std::size_t comma = frames.rfind(',', kLongestText);
  return comma == std::string::npos ? std::string() : frames.substr(0, comma);
}

std::string record_text(schemas::FarmAttempt attempt) {
  attempt.frames = shortened_range(attempt.frames);
  if (attempt.end) {
    attempt.end->reason.resize(std::min(attempt.end->reason.size(), kLongestText));
    attempt.end->failed_frames = shortened_range(attempt.end->failed_frames);
  }
  return padded(schemas::format_farm_attempt(attempt));
}

bool write_all(int descriptor, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t written = write(descriptor, text.data() + done, text.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    done += static_cast<std::size_t>(written);
  }
  return true;
}

/// Returns the attempt that a file name such as "render.0003.02.json" identifies, or nothing.
std::optional<schemas::FarmAttempt> attempt_from_name(const std::string& name) {
  const std::size_t first = name.find('.'), second = name.find('.', first + 1);
  if (first == std::string::npos || second == std::string::npos || !name.ends_with(".json") ||
      name.starts_with('.')) {
    return std::nullopt;
  }
  schemas::FarmAttempt attempt;
  attempt.stage = name.substr(0, first);
  attempt.node = "unknown";
  const auto number = [&](std::size_t begin, std::size_t end) {
    return parse_number<int>(std::string_view(name).substr(begin, end - begin));
  };
  const auto index = number(first + 1, second), count = number(second + 1, name.size() - 5);
  if (!index || !count) return std::nullopt;
  attempt.index = *index;
  attempt.attempt = *count;
  return attempt;
}

}  // namespace

std::string attempt_name(const schemas::FarmAttempt& attempt) {
  return fmt::format("{}.{:04}.{:02}", attempt.stage, attempt.index, attempt.attempt);
}

fs::path attempt_log(const JobFolder& folder, const schemas::FarmAttempt& attempt) {
  return folder.logs() / (attempt_name(attempt) + ".log");
}

void record_attempt_start(const JobFolder& folder, schemas::FarmAttempt& attempt) {
  for (attempt.attempt = 1;; ++attempt.attempt) {
    const fs::path file = record_file(folder, attempt);
    const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0 && errno == EEXIST) continue;
    const bool written = descriptor >= 0 && write_all(descriptor, record_text(attempt));
    const int error = errno;
    if (descriptor >= 0) close(descriptor);
    if (written) return;
    errno = error;
    throw Error::from_errno("the start of the attempt cannot be recorded", file.string(),
                            "Check the folder's permissions and the free space on the disk");
  }
}

void record_attempt_end(const JobFolder& folder, const schemas::FarmAttempt& attempt) {
  const std::string text = record_text(attempt);
  const fs::path file = record_file(folder, attempt);
  try {
    write_file_atomically(file, text);
    return;
  } catch (const Error&) {
    // On a full disk, overwrite the blocks of the start.
    const int descriptor = open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
    if (descriptor < 0) throw;
    const bool written = write_all(descriptor, text);
    close(descriptor);
    if (!written) throw;
  }
}

TaskAttempts read_attempts(const JobFolder& folder) {
  TaskAttempts tasks;
  for (const ContainedPath& file : entries_of(folder.contained(folder.attempts()))) {
    auto attempt = attempt_from_name(file.relative.filename().string());
    if (!attempt) continue;
    if (const auto text = read_record(file)) {
      try {
        attempt = schemas::parse_farm_attempt(*text, file.path().string());
      } catch (const Error&) {  // being written, or damaged: only its name is known
      }
    }
    tasks[{attempt->stage, attempt->index}].push_back(std::move(*attempt));
  }
  for (auto& [task, attempts] : tasks)
    std::ranges::sort(attempts, {}, &schemas::FarmAttempt::attempt);
  return tasks;
}

}  // namespace raystage::farm
