// SPDX-License-Identifier: Apache-2.0
#include "farm/fingerprints.h"

#include <fmt/format.h>

#include <sstream>

#include "farm/job_folder.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFolder = "fingerprints";
constexpr std::size_t kMostBytes = std::size_t{1} << 30;  // a task may have millions of frames

}  // namespace

fs::path fingerprints_file(const fs::path& job_folder, int task) {
  return job_folder / kFolder / fmt::format("render.{:04}", task);
}

std::map<int, std::string> read_fingerprints(const fs::path& job_folder) {
  std::map<int, std::string> known;
  for (const ContainedPath& entry : entries_of({job_folder, kFolder})) {
    if (entry.relative.filename().string().starts_with('.')) continue;  // not complete
    std::istringstream file(read_record(entry, kMostBytes).value_or(""));
    for (std::string line; std::getline(file, line);) {
      std::istringstream words(line);
      int frame = 0;
      std::string fingerprint;
      if (words >> frame >> fingerprint) known[frame] = fingerprint;
    }
  }
  return known;
}

}  // namespace raystage::farm
