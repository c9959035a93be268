// SPDX-License-Identifier: Apache-2.0
// Lists what a folder holds. A take is described from take.json, the sizes of its archives, and the
// first and the last record of one journal: long takes cost no more than short ones.
#include "replay/folder_listing.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "replay/live/live_take.h"
#include "replay/shot_files.h"
#include "replay/source_pictures.h"
#include "replay/take_shot.h"
#include "schemas/shot_document.h"
#include "schemas/take_document.h"
#include "store/intact_frame.h"
#include "store/journal_tail.h"
#include "store/take.h"

namespace raystage::replay {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxEntries = 2000, kMaxFilesSeen = 20'000;
/// A report states its result before its problems, which may be many.
constexpr std::size_t kVerificationBytesRead = 65'536;

Nanoseconds utc_of(const fs::path& file) {
  std::error_code error;
  const fs::file_time_type time = fs::last_write_time(file, error);
  if (error) return 0;
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::file_clock::to_sys(time).time_since_epoch())
      .count();
}

/// Returns the member "intact" of a report of which the beginning is given.
std::optional<bool> find_intact(std::string_view report) {
  using Json = nlohmann::json;
  std::optional<bool> intact;
  bool is_next = false;
  const auto note = [&](int depth, Json::parse_event_t event, Json& value) {
    if (event == Json::parse_event_t::key) {
      is_next = depth == 1 && value == "intact";
    } else if (event == Json::parse_event_t::value && depth == 1 && is_next && value.is_boolean()) {
      intact = value.get<bool>();
    }
    return true;
  };
  [[maybe_unused]] const Json rest = Json::parse(report, note, false);  // its end may be missing
  return intact;
}

void add_verification(const fs::path& folder, FolderEntry& entry) {
  const fs::path file = folder / (entry.name + ".verify.json");
  std::error_code error;
  if (fs::is_symlink(file, error) || !fs::is_regular_file(file, error)) return;
  std::string text(kVerificationBytesRead, '\0');
  text.resize(read_file_part(file, 0, std::as_writable_bytes(std::span(text))));
  if (const auto is_intact = find_intact(text)) {
    entry.verified_utc = utc_of(file);
    entry.is_intact = *is_intact;
  }
}

void describe_take(const fs::path& folder, FolderEntry& entry) {
  const fs::path take = folder / entry.name;
  const schemas::TakeDocument document = schemas::read_take(ContainedPath{take, "take.json"});
  entry.title = document.name;
  entry.cameras = static_cast<int>(document.cameras.size());
  entry.recorded_utc = document.epoch_utc;
  for (const schemas::TakeDocument::Camera& camera : document.cameras) {
    std::error_code error;
    const std::uintmax_t bytes = fs::file_size(take / camera.archive, error);
    if (!error) entry.bytes += bytes;
  }
  if (const auto range = store::journal_time_range({take, document.cameras.front().journal})) {
    entry.seconds = static_cast<double>(range->end - range->begin) * 1e-9;
    if (document.nominal_fps > 0) entry.seconds += 1 / document.nominal_fps;  // of the last frame
  }
  entry.is_recording = is_being_recorded(take);
  add_verification(folder, entry);
}

/// Returns the entry for a path, or nullopt if it is none of a take, a shot and a folder.
std::optional<FolderEntry> describe(const fs::directory_entry& path) {
  std::error_code error;
  FolderEntry entry;
  entry.name = path.path().filename().string();
  if (entry.name.starts_with('.') || path.is_symlink(error)) return std::nullopt;
  const fs::path folder = path.path().parent_path();
  try {
    if (path.is_directory(error)) {
      const fs::file_status status = fs::symlink_status(path.path() / "take.json", error);
      if (!fs::exists(status)) return entry;
      if (!fs::is_regular_file(status)) {
        throw Error::bad_input("take.json is no file", path.path().string(), "Restore the take");
      }
      entry.kind = FolderEntry::Kind::kTake;
      describe_take(folder, entry);
      return entry;
    }
    if (path.path().extension() != ".json" || !path.is_regular_file(error) ||
        path.file_size(error) > kMaxShotBytes || error) {
      return std::nullopt;
    }
    // Other documents are no shots: their "schema" says so.
    const std::string text = read_file(path.path());
    if (text.find("raystage/shot/") == std::string::npos ||
        entry.name.ends_with(".autosave.json")) {
      return std::nullopt;
    }
    entry.kind = FolderEntry::Kind::kShot;
    entry.title = schemas::parse_shot(text, entry.name).name;
  } catch (const Error& problem) {
    entry.problem = problem.what_happened();
  }
  return entry;
}

}  // namespace

std::vector<FolderEntry> list_folder(const fs::path& folder) {
  std::vector<FolderEntry> entries;
  std::error_code error;
  std::size_t seen = 0;
  for (fs::directory_iterator path(folder, error), end; !error && path != end;
       path.increment(error)) {
    if (entries.size() >= kMaxEntries || ++seen > kMaxFilesSeen) break;
    if (auto entry = describe(*path)) entries.push_back(std::move(*entry));
  }
  if (error) {
    throw Error::bad_input("the folder cannot be read: " + error.message(), folder.string(),
                           "Choose another folder");
  }
  std::ranges::sort(entries, {}, [](const FolderEntry& e) { return std::pair(e.kind, e.name); });
  return entries;
}

store::RgbImage take_thumbnail(const fs::path& folder, int width, int height) {
  const store::Take take(folder);
  const int camera = central_camera(take.rig());
  const auto frames = static_cast<int>(take.archive(camera).frames().size());
  store::FrameSelection middle;
  middle.frame.assign(static_cast<std::size_t>(take.camera_count()), -1);
  middle.frame[static_cast<std::size_t>(camera)] =
      store::intact_frame_near(take.archive(camera), frames / 2).value_or(-1);
  return source_picture({take, middle}, camera, width, height);
}

}  // namespace raystage::replay
