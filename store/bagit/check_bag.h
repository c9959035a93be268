// SPDX-License-Identifier: Apache-2.0
// Checks a bag against RFC 8493 (BagIt 1.0) or the draft that it declares, 0.93 to 0.97. Input: a
// folder that anybody may have made; output: what is wrong with it, and the level of check that
// finds it. Cost: a listing of the folder; each listed file is read once for all of its checksums.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "store/bagit/tag_files.h"

namespace raystage::store {

/// How much of a bag is checked; each level includes those before it.
enum class BagCheckLevel {
  kQuick,         ///< the declaration, and number and total size of payload files: Payload-Oxum
  kCompleteness,  ///< manifests, fetch.txt and bag-info.txt can be read; every listed file exists
  kChecksums      ///< every listed file has its checksums
};

struct BagProblem {
  std::string file;  ///< relative to the bag, as manifests write it
  std::string what;
  BagCheckLevel found_by = BagCheckLevel::kCompleteness;  ///< the least level that finds it
};

struct BagReport {
  BagDeclaration declaration;
  BagInfo info;
  std::vector<std::string> algorithms;  ///< of the payload manifests
  std::uint64_t payload_files = 0, payload_bytes = 0;
  std::uint64_t checked_bytes = 0;     ///< that were read to compare checksums
  std::vector<BagProblem> problems;    ///< any of them makes the bag invalid; sorted by file
  std::vector<BagProblem> warnings;    ///< the bag is valid, but programs may differ in reading it
  std::uint64_t omitted_problems = 0;  ///< not listed, because there are more than kMaxListed
  double seconds = 0;
  RunStatus status = RunStatus::kNotRun;

  static constexpr std::size_t kMaxListed = 1000;
  bool is_valid() const { return problems.empty(); }  ///< as far as it was checked
};

struct BagCheckOptions {
  BagCheckLevel level = BagCheckLevel::kChecksums;
  /// Of all tag files that are read, together: their contents are kept while the bag is checked.
  std::uint64_t max_tag_bytes = std::uint64_t{512} << 20;
  std::function<void(double)> progress;  ///< called with the share done, 0 to 1, from any thread
  std::stop_token stop;
};

/// Checks a bag. Links are never followed, and are problems. Throws Error (bad input) if the folder
/// cannot be read, holds neither bagit.txt nor data/, or declares a version after 1.0.
BagReport check_bag(const std::filesystem::path& folder, const BagCheckOptions& options);

}  // namespace raystage::store
