// SPDX-License-Identifier: Apache-2.0
#include "store/bagit/check_bag.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <system_error>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/stopwatch.h"
#include "store/bagit/digests.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDeclarationFile = "bagit.txt";
constexpr std::string_view kPayload = "data/";
constexpr std::string_view kManifestStart = "manifest-", kTagManifestStart = "tagmanifest-";
constexpr std::uint64_t kMaxDeclarationBytes = 4096;
constexpr std::uint64_t kMaxTagFileBytes = std::uint64_t{256} << 20;
constexpr std::size_t kMaxManifests = 32;        // of payload, and of tag files
constexpr std::size_t kMaxEntries = 20'000'000;  // of a folder: each takes memory
constexpr BagVersion kKnownVersions[] = {{0, 93}, {0, 94}, {0, 95}, {0, 96}, {0, 97}, {1, 0}};

/// The checksums of a file that must hold.
struct Expected {
  struct Checksum {
    DigestAlgorithm algorithm;
    std::string digest, manifest;
  };
  std::vector<Checksum> checksums;
};

class BagChecker {
 public:
  BagChecker(const fs::path& folder, const BagCheckOptions& options)
      : folder_(folder), options_(options), tag_bytes_left_(options.max_tag_bytes) {}

  BagReport run() {
    const Stopwatch watch;
    list_files();
    if (read_declaration()) {
      read_info();
      compare_oxum();
      if (options_.level >= BagCheckLevel::kCompleteness) check_completeness();
      if (options_.level >= BagCheckLevel::kChecksums) compare_checksums();
    }
    std::ranges::stable_sort(report_.problems, {}, &BagProblem::file);
    report_.seconds = watch.seconds();
    if (report_.status == RunStatus::kNotRun) report_.status = RunStatus::kFinished;
    return std::move(report_);
  }

 private:
  void problem(const std::string& file, std::string what, BagCheckLevel found_by) {
    const std::scoped_lock lock(mutex_);
    if (report_.problems.size() < BagReport::kMaxListed) {
      report_.problems.push_back({encode_bag_path(file), std::move(what), found_by});
    } else {
      ++report_.omitted_problems;
    }
  }
  void warn(const std::string& file, std::string what) {
    if (report_.warnings.size() >= BagReport::kMaxListed) return;
    report_.warnings.push_back(
        {encode_bag_path(file), std::move(what), BagCheckLevel::kCompleteness});
  }
  void add(const std::string& file, const TagFileFindings& findings, BagCheckLevel found_by) {
    for (const std::string& what : findings.faults()) problem(file, what, found_by);
    for (const std::string& what : findings.warnings()) warn(file, what);
    const std::scoped_lock lock(mutex_);
    report_.omitted_problems += findings.omitted();
  }

  /// Lists all files of the bag and their sizes.
  void list_files() {
    std::error_code error;
    fs::recursive_directory_iterator entry(folder_, error);
    std::size_t entries = 0;
    for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
      if (++entries > kMaxEntries) {
        throw Error::bad_input(fmt::format("the folder has more than {} entries", kMaxEntries),
                               folder_.string(), "Check its parts on their own");
      }
      const std::string relative = entry->path().lexically_relative(folder_).string();
      std::error_code unknown;
      const fs::file_type type = entry->symlink_status(unknown).type();
      if (type == fs::file_type::directory) {
        has_payload_folder_ = has_payload_folder_ || relative == "data";
      } else if (type == fs::file_type::regular) {
        const std::uintmax_t size = entry->file_size(unknown);
        files_.emplace(relative, unknown ? 0 : size);
      } else {
        problem(relative, "it is a link or a special file, which no bag may hold",
                BagCheckLevel::kQuick);
      }
    }
    if (error) {
      throw Error::bad_input("the folder cannot be read: " + error.message(), folder_.string(),
                             "Check the path and its permissions");
    }
    if (!files_.contains(kDeclarationFile) && !has_payload_folder_) {
      throw Error::bad_input("the folder is no bag: it has neither bagit.txt nor data/",
                             folder_.string(), "Give the folder that holds bagit.txt");
    }
    if (!has_payload_folder_) problem("data", "the folder is missing", BagCheckLevel::kQuick);
    for (const auto& [path, size] : files_) {
      if (!path.starts_with(kPayload)) continue;
      ++report_.payload_files;
      report_.payload_bytes += size;
    }
  }

  /// Returns the bytes of a tag file, or nullopt if it cannot be read.
  std::optional<std::string> bytes_of(const std::string& file, std::uint64_t most,
                                      BagCheckLevel found_by) {
    try {
      return read_file(ContainedPath{folder_, file}, most);
    } catch (const Error& error) {
      problem(file, error.what_happened(), found_by);
      return std::nullopt;
    }
  }

  std::optional<std::string> text_of(const std::string& file, BagCheckLevel found_by) {
    if (files_.at(file) > tag_bytes_left_) {
      problem(file,
              fmt::format("it was not read, because the tag files have more than {} bytes together",
                          options_.max_tag_bytes),
              found_by);
      return std::nullopt;
    }
    const auto bytes = bytes_of(file, std::min(kMaxTagFileBytes, tag_bytes_left_), found_by);
    if (!bytes) return std::nullopt;
    tag_bytes_left_ -= bytes->size();
    TagFileFindings findings;
    auto text = utf8_of_tag_file(*bytes, report_.declaration.encoding, findings);
    add(file, findings, found_by);
    return text;
  }

  /// Returns false if nothing else of the bag can be read.
  bool read_declaration() {
    if (!files_.contains(kDeclarationFile)) {
      problem(kDeclarationFile, "the file is missing", BagCheckLevel::kQuick);
      return false;
    }
    const auto bytes = bytes_of(kDeclarationFile, kMaxDeclarationBytes, BagCheckLevel::kQuick);
    if (!bytes) return false;
    TagFileFindings findings;
    const auto declaration = parse_bag_declaration(*bytes, findings);
    add(kDeclarationFile, findings, BagCheckLevel::kQuick);
    if (!declaration) return false;
    report_.declaration = *declaration;
    const BagVersion version = declaration->version;
    const std::string text = fmt::format("{}.{}", version.major, version.minor);
    if (version > kBagVersion1) {
      throw Error::bad_input(fmt::format("the bag has version {} of BagIt, after 1.0", text),
                             (folder_ / kDeclarationFile).string(), "Check it by a newer program");
    }
    if (std::ranges::find(kKnownVersions, version) == std::end(kKnownVersions)) {
      problem(kDeclarationFile, fmt::format("there is no version {} of BagIt", text),
              BagCheckLevel::kQuick);
      return false;
    }
    return true;
  }

  void read_info() {
    // The name changed with version 0.96.
    const bool is_old = report_.declaration.version < BagVersion{0, 96};
    const std::string file = is_old ? "package-info.txt" : "bag-info.txt";
    if (!files_.contains(file)) return;
    const auto text = text_of(file, BagCheckLevel::kQuick);
    if (!text) return;
    TagFileFindings findings;
    report_.info = parse_bag_info(*text, report_.declaration.version, findings);
    add(file, findings, BagCheckLevel::kQuick);
  }

  void compare_oxum() {
    const auto& oxum = report_.info.oxum;
    if (!oxum && options_.level == BagCheckLevel::kQuick) {
      problem("bag-info.txt", "it states no Payload-Oxum, which is what a quick check compares",
              BagCheckLevel::kQuick);
    }
    if (!oxum || (oxum->bytes == report_.payload_bytes && oxum->files == report_.payload_files)) {
      return;
    }
    problem("data",
            fmt::format("it holds {} bytes in {} files, but Payload-Oxum states {} in {}",
                        report_.payload_bytes, report_.payload_files, oxum->bytes, oxum->files),
            BagCheckLevel::kQuick);
  }

  /// Reads a manifest of the base folder, and records its checksums. Returns its paths, or nullopt
  /// if it cannot be read.
  std::optional<std::vector<std::string>> read_manifest_file(const std::string& file,
                                                             std::string_view start) {
    constexpr std::string_view kEnd = ".txt";
    const std::string_view name =
        std::string_view(file).substr(start.size(), file.size() - start.size() - kEnd.size());
    const auto algorithm = digest_algorithm(name);
    const auto text = text_of(file, BagCheckLevel::kCompleteness);
    if (!text) return std::nullopt;
    TagFileFindings findings;
    BagManifest manifest = parse_bag_manifest(*text, report_.declaration.version,
                                              algorithm ? digest_digits(*algorithm) : 0, findings);
    add(file, findings, BagCheckLevel::kCompleteness);
    if (!algorithm) {
      warn(file, fmt::format("its checksums, {}, are not supported and not compared", name));
    } else if (start == kManifestStart) {
      report_.algorithms.emplace_back(digest_name(*algorithm));
    }
    std::vector<std::string> paths;
    for (BagManifest::Entry& entry : manifest.entries) {
      const bool is_payload = entry.path.starts_with(kPayload);
      if (is_payload != (start == kManifestStart)) {
        problem(file,
                fmt::format("\"{}\" is {}", encode_bag_path(entry.path),
                            is_payload ? "a payload file, which no tag manifest may list"
                                       : "outside of data/"),
                BagCheckLevel::kCompleteness);
        continue;
      }
      if (!files_.contains(entry.path)) {
        missing_[entry.path] = file;
      } else if (algorithm) {
        expected_[entry.path].checksums.push_back({*algorithm, std::move(entry.digest), file});
      }
      paths.push_back(std::move(entry.path));
    }
    return paths;
  }

  std::vector<std::string> files_named(std::string_view start) const {
    std::vector<std::string> names;
    for (const auto& [path, size] : files_) {
      if (path.starts_with(start) && path.ends_with(".txt") &&
          path.find('/') == std::string::npos && path.size() > start.size() + 4) {
        names.push_back(path);
      }
    }
    if (names.size() > kMaxManifests) {
      throw Error::bad_input(fmt::format("the bag has {} files {}*.txt", names.size(), start),
                             folder_.string(),
                             fmt::format("Keep at most {}: one for each algorithm", kMaxManifests));
    }
    return names;
  }

  void check_completeness() {
    const bool is_version_1 = report_.declaration.version >= kBagVersion1;
    std::map<std::string, std::vector<std::string>> manifests;  // paths of each, sorted
    for (const std::string& file : files_named(kManifestStart)) {
      if (auto paths = read_manifest_file(file, kManifestStart)) {
        manifests.emplace(file, std::move(*paths));
      }
    }
    if (files_named(kManifestStart).empty()) {
      problem("manifest-*.txt", "there is no payload manifest", BagCheckLevel::kCompleteness);
    } else if (report_.algorithms.empty()) {
      problem("manifest-*.txt", "no payload manifest has checksums that are supported",
              BagCheckLevel::kCompleteness);
    }
    const auto lists = [](const std::vector<std::string>& paths, const std::string& path) {
      return std::ranges::binary_search(paths, path);
    };
    // Of a file that is only in some manifests of a bag of version 1.0, each other one is named.
    std::vector<std::string> listed;
    for (const auto& [file, paths] : manifests) {
      std::vector<std::string> both;
      std::ranges::set_union(listed, paths, std::back_inserter(both));
      listed.swap(both);
    }
    for (const auto& [path, size] : files_) {
      if (path.starts_with(kPayload) && !lists(listed, path)) {
        problem(path, "no payload manifest lists it", BagCheckLevel::kCompleteness);
      }
    }
    for (const auto& [file, paths] : manifests) {
      if (!is_version_1) break;
      for (const std::string& path : listed) {
        if (lists(paths, path)) continue;
        problem(path, "another payload manifest lists it, but not " + file,
                BagCheckLevel::kCompleteness);
      }
    }
    check_fetch(listed);
    for (const std::string& file : files_named(kTagManifestStart)) check_tag_manifest(file);
    for (const auto& [path, file] : missing_) {
      problem(path,
              fmt::format("it is missing, but {} lists it{}", file,
                          fetched_.contains(path) ? ": it must be fetched, see fetch.txt" : ""),
              BagCheckLevel::kCompleteness);
    }
  }

  void check_fetch(const std::vector<std::string>& listed) {
    const std::string file = "fetch.txt";
    if (!files_.contains(file)) return;
    const auto text = text_of(file, BagCheckLevel::kCompleteness);
    if (!text) return;
    TagFileFindings findings;
    const auto entries = parse_bag_fetch(*text, report_.declaration.version, findings);
    add(file, findings, BagCheckLevel::kCompleteness);
    for (const BagFetchEntry& entry : entries) {
      fetched_.emplace(entry.path, entry.url);
      const std::string path = encode_bag_path(entry.path);
      if (!entry.path.starts_with(kPayload)) {
        problem(file, fmt::format("\"{}\" is outside of data/", path),
                BagCheckLevel::kCompleteness);
      } else if (!std::ranges::binary_search(listed, entry.path)) {
        problem(file, fmt::format("no payload manifest lists \"{}\"", path),
                BagCheckLevel::kCompleteness);
      }
      const auto present = files_.find(entry.path);
      if (present != files_.end() && entry.bytes && *entry.bytes != present->second) {
        problem(
            entry.path,
            fmt::format("it has {} bytes, but fetch.txt states {}", present->second, *entry.bytes),
            BagCheckLevel::kCompleteness);
      }
    }
  }

  void check_tag_manifest(const std::string& file) {
    const auto paths = read_manifest_file(file, kTagManifestStart);
    if (!paths) return;
    for (const std::string& path : *paths) {
      if (path.starts_with(kTagManifestStart) && path.find('/') == std::string::npos) {
        problem(file, fmt::format("it lists the tag manifest \"{}\"", path),
                BagCheckLevel::kCompleteness);
      }
    }
    for (const std::string& manifest : files_named(kManifestStart)) {
      if (std::ranges::binary_search(*paths, manifest)) continue;
      const std::string what = fmt::format("it does not list {}", manifest);
      if (report_.declaration.version >= kBagVersion1) {
        problem(file, what, BagCheckLevel::kCompleteness);
      } else {
        warn(file, what);
      }
    }
  }

  void compare_checksums() {
    std::vector<const std::pair<const std::string, Expected>*> jobs;
    std::uint64_t total = 0;
    for (const auto& job : expected_) {
      jobs.push_back(&job);
      total += files_.at(job.first);
    }
    std::atomic<std::uint64_t> done = 0;
    tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t i) {
      if (options_.stop.stop_requested()) return;
      compare_file(jobs[i]->first, jobs[i]->second, done, total);
    });
    report_.checked_bytes = done;
    if (options_.stop.stop_requested()) report_.status = RunStatus::kStopped;
  }

  void compare_file(const std::string& path, const Expected& expected,
                    std::atomic<std::uint64_t>& done, std::uint64_t total) {
    std::vector<DigestAlgorithm> algorithms;
    for (const auto& checksum : expected.checksums) algorithms.push_back(checksum.algorithm);
    Digests digests(algorithms);
    try {
      const bool is_read = read_in_parts({folder_, path}, [&](std::span<const std::byte> part) {
        digests.update(part);
        const std::uint64_t now = done += part.size();
        if (options_.progress) {
          options_.progress(static_cast<double>(now) / static_cast<double>(std::max(total, now)));
        }
        return !options_.stop.stop_requested();
      });
      if (!is_read) return;
    } catch (const Error& error) {
      problem(path, error.what_happened(), BagCheckLevel::kChecksums);
      return;
    }
    const std::vector<std::string> found = digests.hex();
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (found[i] == expected.checksums[i].digest) continue;
      problem(path,
              fmt::format("its {} differs from {}", digest_name(algorithms[i]),
                          expected.checksums[i].manifest),
              BagCheckLevel::kChecksums);
    }
  }

  const fs::path folder_;
  const BagCheckOptions& options_;
  std::uint64_t tag_bytes_left_;
  BagReport report_;
  std::mutex mutex_;
  bool has_payload_folder_ = false;
  std::map<std::string, std::uint64_t> files_;  // regular files and their sizes
  std::map<std::string, std::string> missing_;  // listed path and a manifest that lists it
  std::map<std::string, std::string> fetched_;  // path and URL
  std::map<std::string, Expected> expected_;    // of files that exist
};

}  // namespace

BagReport check_bag(const fs::path& folder, const BagCheckOptions& options) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    throw Error::bad_input("there is no such folder", folder.string(), "Give the folder of a bag");
  }
  return BagChecker(folder, options).run();
}

}  // namespace raystage::store
