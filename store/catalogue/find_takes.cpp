// SPDX-License-Identifier: Apache-2.0
#include "store/catalogue/find_takes.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <system_error>

#include "base/error.h"
#include "schemas/utf8_text.h"
#include "store/fixity/event_log.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

/// Names in a folder but hidden ones and links.
struct FolderListing {
  std::vector<fs::path> folders, files;
  bool is_empty = true;   // also of hidden files and links
  std::error_code error;  // the names are not complete
};

bool is_gone(const std::error_code& error) { return error == std::errc::no_such_file_or_directory; }

FolderListing list_folder(const fs::path& folder) {
  FolderListing listing;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    listing.is_empty = false;
    const fs::path name = entry->path().filename();
    if (name.string().starts_with(".")) continue;
    std::error_code of_entry;
    const fs::file_type type = fs::symlink_status(entry->path(), of_entry).type();
    if (type == fs::file_type::directory) listing.folders.push_back(name);
    if (type == fs::file_type::regular) listing.files.push_back(name);
    if (type == fs::file_type::none) listing.error = of_entry;
  }
  if (error) listing.error = error;
  return listing;
}

void search(const fs::path& top, const fs::path& relative, int depth, FoundTakes& found) {
  constexpr int kMaxDepth = 64;
  const fs::path folder = relative.empty() ? top : top / relative;
  const std::string name = relative.empty() ? "." : relative.string();
  const auto add_problem = [&](const std::error_code& error) {
    found.problems.push_back({name, "the folder cannot be read: " + error.message()});
  };
  std::error_code error;
  const fs::file_type document = fs::symlink_status(folder / "take.json", error).type();
  if (document == fs::file_type::none) return add_problem(error);
  if (document == fs::file_type::regular) {
    if (schemas::is_utf8(name)) {
      found.paths.push_back(name);
    } else {
      found.problems.push_back(
          {name, "the take cannot be checked, because its path is not UTF-8: rename it"});
    }
    return;
  }
  if (depth >= kMaxDepth) {
    found.problems.push_back({name, "more than 64 folders within each other"});
    return;
  }
  const FolderListing listing = list_folder(folder);
  if (listing.error) {
    add_problem(listing.error);
  } else if (listing.is_empty) {
    found.empty_folders.push_back(name);
  }
  for (const fs::path& below : listing.folders) search(top, relative / below, depth + 1, found);
}

/// Appends a line for each file below a folder of a take.
void add_state(const fs::path& take, const fs::path& relative, std::vector<std::string>& lines) {
  const fs::path folder = relative.empty() ? take : take / relative;
  const auto require = [](const std::error_code& error, const fs::path& path) {
    if (!error) return;
    throw Error::failed(
        "the take cannot be checked, because this cannot be read: " + error.message(),
        path.string(), "Check its permissions and the disk");
  };
  const FolderListing listing = list_folder(folder);
  require(listing.error, folder);
  for (const fs::path& file : listing.files) {
    const fs::path name = relative / file;
    if (name == kEventLogFile) continue;  // which every check makes longer
    std::error_code error;
    const auto size = fs::file_size(take / name, error);
    const auto changed = error ? fs::file_time_type() : fs::last_write_time(take / name, error);
    if (is_gone(error)) continue;
    require(error, take / name);
    lines.push_back(
        fmt::format("{}\n{}\n{}\n", name.string(), size, changed.time_since_epoch().count()));
  }
  for (const fs::path& below : listing.folders) {
    if (relative / below != "depth") add_state(take, relative / below, lines);
  }
}

}  // namespace

FoundTakes find_takes(const fs::path& folder) {
  FoundTakes found;
  search(folder, {}, 0, found);
  std::ranges::sort(found.paths);
  return found;
}

bool is_at_or_below(std::string_view path, std::string_view folder) {
  if (folder == "." || path == folder) return true;
  return path.starts_with(folder) && path.substr(folder.size()).starts_with("/");
}

std::string state_of_take(const fs::path& take) {
  std::vector<std::string> lines;
  add_state(take, {}, lines);
  std::ranges::sort(lines);
  std::string all;
  for (const std::string& line : lines) all += line;
  return fmt::format("{:016x}", XXH3_64bits(all.data(), all.size()));
}

}  // namespace raystage::store
