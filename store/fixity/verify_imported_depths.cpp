// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/verify_imported_depths.h"

#include <string>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/mapped_file.h"
#include "store/imported_depths.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using Document = schemas::ImportedDepthsDocument;

/// Returns what is wrong with a map; empty if it is intact.
std::string fault_of(const Take& take, const Document::Map& map, const TakeVerifyOptions& options) {
  const ContainedPath file = take.file(fs::path(Document::kFolder) / map.file);
  if (options.depth == VerifyDepth::kSizes) {
    const MappedFile is_there(file);
    return "";
  }
  return has_stated_hash(file, options.before_read)
             ? ""
             : "the depth map is not as it was imported (XXH3 in its name)";
}

}  // namespace

std::vector<FixityProblem> verify_imported_depths(const Take& take,
                                                  const TakeVerifyOptions& options) {
  std::vector<FixityProblem> problems;
  const auto complain = [&](const fs::path& file, const std::string& what) {
    problems.push_back({file.string(),
                        0,
                        what + "; restore it from a copy, or import the depth maps again",
                        {},
                        false});
  };
  Document document;
  try {
    document = read_imported_depths(take);
  } catch (const Error& error) {
    complain(Document::kFile, error.what_happened());
    return problems;
  }
  for (const Document::Camera& camera : document.cameras) {
    for (const Document::Map& map : camera.maps) {
      if (options.stop.stop_requested()) return problems;
      if (problems.size() == kMaxProblems) {
        problems.back().what = "more than " + std::to_string(kMaxProblems - 1) +
                               " depth maps are missing or damaged; the rest was not checked";
        return problems;
      }
      const fs::path file = fs::path(Document::kFolder) / map.file;
      try {
        const std::string fault = fault_of(take, map, options);
        if (!fault.empty()) complain(file, fault);
      } catch (const Error& error) {
        complain(file, error.what_happened());
      }
    }
  }
  return problems;
}

}  // namespace raystage::store
