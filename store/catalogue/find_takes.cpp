// SPDX-License-Identifier: Apache-2.0
#include "store/catalogue/find_takes.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <system_error>

#include "store/fixity/event_log.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

bool is_hidden(const fs::path& path) { return path.filename().string().starts_with("."); }

bool has_take_document(const fs::path& folder) {
  std::error_code error;
  return fs::symlink_status(folder / "take.json", error).type() == fs::file_type::regular;
}

void search(const fs::path& top, const fs::path& relative, int depth, FoundTakes& found) {
  constexpr int kMaxDepth = 64;
  const fs::path folder = relative.empty() ? top : top / relative;
  if (has_take_document(folder)) {
    found.paths.push_back(relative.empty() ? "." : relative.string());
    return;
  }
  if (depth >= kMaxDepth) {
    found.problems.push_back(relative.string() + ": more than 64 folders within each other");
    return;
  }
  std::error_code error;
  std::vector<fs::path> folders;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code of_entry;
    if (entry->symlink_status(of_entry).type() == fs::file_type::directory &&
        !is_hidden(entry->path())) {
      folders.push_back(entry->path().filename());
    }
  }
  if (error) {
    found.problems.push_back((relative.empty() ? "." : relative.string()) +
                             ": the folder cannot be read: " + error.message());
  }
  for (const fs::path& name : folders) search(top, relative / name, depth + 1, found);
}

}  // namespace

FoundTakes find_takes(const fs::path& folder) {
  FoundTakes found;
  search(folder, {}, 0, found);
  std::ranges::sort(found.paths);
  return found;
}

std::string state_of_take(const fs::path& take) {
  std::vector<std::string> lines;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(take, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path name = entry->path().lexically_relative(take);
    std::error_code of_entry;
    if (is_hidden(name) || name == "depth") {
      entry.disable_recursion_pending();
      continue;
    }
    if (name == kEventLogFile) continue;  // which every check makes longer
    if (!entry->is_regular_file(of_entry)) continue;
    const auto size = entry->file_size(of_entry);
    const auto changed = entry->last_write_time(of_entry).time_since_epoch().count();
    lines.push_back(fmt::format("{}\n{}\n{}\n", name.string(), size, changed));
  }
  std::ranges::sort(lines);
  std::string all;
  for (const std::string& line : lines) all += line;
  return fmt::format("{:016x}", XXH3_64bits(all.data(), all.size()));
}

}  // namespace raystage::store
