// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/event_log.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <span>
#include <thread>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "schemas/take_document.h"
#include "store/bag_payload.h"
#include "store/fixity/sha256.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCheckLog = "Check the disk and the permissions of the take's folder";

/// A random UUID (RFC 4122, version 4).
std::string random_uuid() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw Error::from_errno("no random numbers are available", "", "Check the kernel");
  }
  bytes[6] = static_cast<unsigned char>(0x40u | (bytes[6] & 0x0fu));
  bytes[8] = static_cast<unsigned char>(0x80u | (bytes[8] & 0x3fu));
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (i == 4 || i == 6 || i == 8 || i == 10) text += '-';
    text += fmt::format("{:02x}", bytes[i]);
  }
  return text;
}

bool is_read_only(int reason) { return reason == EROFS || reason == EACCES || reason == EPERM; }

/// Waits for the lock; another command holds it for milliseconds.
void lock_log(const FileDescriptor& log, const fs::path& name) {
  constexpr int kTries = 200;
  constexpr std::chrono::milliseconds kPause{25};
  for (int tries = 1; ::flock(log.number(), LOCK_EX | LOCK_NB) != 0; ++tries) {
    const bool is_held = errno == EWOULDBLOCK || errno == EINTR;
    if (!is_held) return;  // the file system has no locks: appending is one write
    if (tries == kTries) {
      throw Error::failed("another program keeps the event log locked", name.string(),
                          "Run the command again when that has ended");
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace

std::string take_digest(const fs::path& take) {
  const schemas::TakeDocument document = schemas::read_take(ContainedPath{take, "take.json"});
  std::vector<std::string> paths{"take.json", "rig.json"};
  for (const auto& camera : document.cameras) paths.push_back(camera.journal);
  std::ranges::sort(paths);
  Sha256 hash;
  for (const std::string& path : paths) {
    const std::string line = fmt::format(
        "{}  {}\n", sha256_of_file({take, path}, [](std::size_t) { return true; }), path);
    hash.update(std::as_bytes(std::span(line)));
  }
  return hash.hex();
}

schemas::TakeEvent make_event(const fs::path& take, schemas::TakeEvent event) {
  const schemas::TakeDocument document = schemas::read_take(ContainedPath{take, "take.json"});
  event.id = random_uuid();
  event.time_utc = std::chrono::duration_cast<std::chrono::nanoseconds>(
                       std::chrono::system_clock::now().time_since_epoch())
                       .count();
  event.take = document.name;
  event.epoch_utc = document.epoch_utc;
  try {
    event.sha256 = take_digest(take);
  } catch (const Error&) {
    event.sha256.clear();  // the event says what is wrong with the take
  }
  return event;
}

bool append_event(const fs::path& take, const schemas::TakeEvent& event) {
  if (is_bag_payload(take)) return false;
  const ContainedPath file{take, kEventLogFile};
  const FileDescriptor log = open_contained(file, O_RDWR | O_CREAT | O_APPEND, 0666);
  if (!log.open()) {
    if (is_read_only(errno)) return false;
    throw contained_open_error(file, errno);
  }
  lock_log(log, file.path());
  struct stat status {};
  if (::fstat(log.number(), &status) != 0 || !S_ISREG(status.st_mode)) {
    throw Error::bad_input("the event log is not a regular file", file.path().string(),
                           "Move it away");
  }
  std::string text = schemas::format_event(event);
  char last = '\n';
  if (status.st_size > 0 && ::pread(log.number(), &last, 1, status.st_size - 1) != 1) {
    throw Error::from_errno("the event log cannot be read", file.path().string(), kCheckLog);
  }
  if (last != '\n') text.insert(text.begin(), '\n');
  if (static_cast<std::uint64_t>(status.st_size) + text.size() > kMaxEventLogBytes) {
    throw Error::bad_input(
        fmt::format("the event log would have more than {} bytes", kMaxEventLogBytes),
        file.path().string(), "Keep it elsewhere, and remove it from the take");
  }
  ssize_t written = 0;
  do {
    written = ::write(log.number(), text.data(), text.size());
  } while (written < 0 && errno == EINTR);
  if (written != static_cast<ssize_t>(text.size()) || ::fdatasync(log.number()) != 0) {
    const int cause = written >= 0 && written < static_cast<ssize_t>(text.size()) ? ENOSPC : errno;
    // Ignored: a line that is not complete is no event.
    [[maybe_unused]] const int ignored = ::ftruncate(log.number(), status.st_size);
    errno = cause;
    throw Error::from_errno("the event log cannot be written", file.path().string(), kCheckLog);
  }
  if (status.st_size == 0) sync_folder(take);
  return true;
}

EventLog parse_event_log(std::string_view text, std::string_view name) {
  EventLog log;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty()) continue;
    try {
      log.events.push_back(schemas::parse_event(line, name));
    } catch (const Error&) {
      ++log.damaged_lines;
    }
  }
  return log;
}

EventLog read_event_log(const fs::path& take) {
  const ContainedPath file{take, kEventLogFile};
  std::error_code error;
  if (!fs::exists(fs::symlink_status(file.path(), error))) return {};
  require_contained(file);
  return parse_event_log(read_file(file, kMaxEventLogBytes), file.path().string());
}

}  // namespace raystage::store
