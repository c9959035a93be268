// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/manifest.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "store/fixity/event_log.h"
#include "store/fixity/sha256.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHeading = "# raystage/manifest/1";
constexpr std::size_t kHashDigits = 64;
constexpr std::uint64_t kMaxManifestBytes = std::uint64_t{64} << 20;

bool has_control_characters(std::string_view text) {
  return std::ranges::any_of(text, [](unsigned char c) { return c < ' ' || c == 0x7f; });
}

bool is_listed(const fs::path& relative) {
  const bool is_own = relative == kManifestFile || relative == kSignatureFile ||
                      relative == kEventLogFile;  // which grows after the manifest is made
  const bool is_hidden = std::ranges::any_of(
      relative, [](const fs::path& part) { return part.string().starts_with('.'); });
  return !is_own && !is_hidden && *relative.begin() != "depth";
}

/// A path below the folder, written in one way only.
bool is_plain(std::string_view path) {
  const fs::path parsed(path);
  return !path.empty() && !has_control_characters(path) && path.find('\\') == std::string::npos &&
         parsed.is_relative() && parsed.lexically_normal().string() == path &&
         parsed.has_filename() && is_listed(parsed);
}

Error stopped(const fs::path& folder) {
  return Error::failed("hashing was stopped", folder.string(), "Start it again");
}

/// Calls hash(i) for all files, several at once, and reports progress by bytes.
class Hashing {
 public:
  Hashing(const fs::path& folder, const std::vector<std::string>& paths,
          const ManifestOptions& options)
      : folder_(folder), options_(options) {
    for (const std::string& path : paths) {
      std::error_code error;
      const std::uintmax_t size = fs::file_size(folder / path, error);
      if (!error) total_ += size;
    }
  }

  /// Returns "" if the run was stopped.
  std::string hash(const std::string& path) {
    return sha256_of_file({folder_, path}, [this](std::size_t bytes) {
      const std::uintmax_t done = done_ += bytes;
      if (options_.progress) {
        const std::uintmax_t total = std::max(total_, done);
        options_.progress(static_cast<double>(done) / static_cast<double>(total));
      }
      return !options_.stop.stop_requested();
    });
  }

 private:
  const fs::path& folder_;
  const ManifestOptions& options_;
  std::uintmax_t total_ = 0;
  std::atomic<std::uintmax_t> done_ = 0;
};

/// The lines of a text, numbered from 1.
class Lines {
 public:
  Lines(std::string_view text, std::string name) : rest_(text), name_(std::move(name)) {}

  bool next(std::string_view& line) {
    if (rest_.empty()) return false;
    ++number_;
    const std::size_t end = rest_.find('\n');
    if (end == std::string_view::npos) throw error("its end is missing");
    line = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    return true;
  }
  /// Returns what follows "# NAME: " in the next line.
  std::string_view property(std::string_view name) {
    std::string_view line;
    const std::string start = fmt::format("# {}: ", name);
    if (!next(line) || !line.starts_with(start)) {
      throw error(fmt::format("\"{}\" is missing", name));
    }
    return line.substr(start.size());
  }
  template <class Number>
  Number number(std::string_view name) {
    const std::string_view text = property(name);
    Number value{};
    const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (code != std::errc() || end != text.data() + text.size()) {
      throw error(fmt::format("\"{}\" is no number", name));
    }
    return value;
  }
  Error error(const std::string& what) const {
    return Error::bad_input(fmt::format("line {} of the manifest: {}", number_, what), name_,
                            "Restore the manifest from another copy of the take");
  }

 private:
  std::string_view rest_;
  std::string name_;
  int number_ = 0;
};

}  // namespace

std::string manifest_as_text(const Manifest& manifest) {
  std::string text = fmt::format("{}\n# take: {}\n# epoch_utc: {}\n# cameras: {}\n", kHeading,
                                 manifest.take, manifest.epoch_utc, manifest.cameras);
  for (const Manifest::File& file : manifest.files) {
    text += fmt::format("{}  {}\n", file.sha256, file.path);
  }
  return text;
}

Manifest parse_manifest(std::string_view text, const std::string& name) {
  Lines lines(text, name);
  std::string_view line;
  if (!lines.next(line) || line != kHeading) {
    throw lines.error(fmt::format("\"{}\" was expected", kHeading));
  }
  Manifest manifest;
  manifest.take = lines.property("take");
  if (has_control_characters(manifest.take)) throw lines.error("the take's name is damaged");
  manifest.epoch_utc = lines.number<Nanoseconds>("epoch_utc");
  manifest.cameras = lines.number<int>("cameras");
  if (manifest.cameras < 0) throw lines.error("the number of cameras is negative");
  while (lines.next(line)) {
    const std::string_view hash = line.substr(0, std::min(line.size(), kHashDigits));
    const bool is_hash = hash.size() == kHashDigits &&
                         hash.find_first_not_of("0123456789abcdef") == std::string_view::npos &&
                         line.substr(kHashDigits).starts_with("  ");
    if (!is_hash) throw lines.error("a SHA-256, two spaces and a path were expected");
    const std::string_view path = line.substr(kHashDigits + 2);
    if (!is_plain(path)) throw lines.error("the path is none of a take's file");
    if (!manifest.files.empty() && path <= manifest.files.back().path) {
      throw lines.error("the paths are not sorted, or one is listed twice");
    }
    manifest.files.push_back({std::string(path), std::string(hash)});
  }
  return manifest;
}

std::vector<std::string> files_of_take(const fs::path& folder) {
  FilesOfTake found = find_files_of_take(folder);
  if (!found.refused.empty()) throw Error(found.refused.front());
  return std::move(found.paths);
}

FilesOfTake find_files_of_take(const fs::path& folder) {
  FilesOfTake found;
  // Not a recursive iterator, which ends at the first folder that cannot be read.
  for (std::vector<fs::path> folders{{}}; !folders.empty();) {
    const fs::path inside = std::move(folders.back());
    folders.pop_back();
    std::error_code error;
    fs::directory_iterator entry(inside.empty() ? folder : folder / inside, error);
    for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
      const fs::path relative = inside / entry->path().filename();
      if (!is_listed(relative)) continue;
      const fs::file_type type = entry->symlink_status(error).type();
      if (error) break;
      if (type == fs::file_type::directory) {
        folders.push_back(relative);
      } else if (type != fs::file_type::regular) {
        found.refused.push_back(Error::bad_input(
            "this is a link or a special file, which no manifest can list", entry->path().string(),
            "Replace it by the file itself, or remove it"));
      } else if (!is_plain(relative.string())) {
        found.refused.push_back(
            Error::bad_input("the file's name holds characters that no manifest can list",
                             entry->path().string(), "Rename the file"));
      } else {
        found.paths.push_back(relative.string());
      }
    }
    if (error) {
      found.refused.push_back(Error::failed("the folder cannot be read: " + error.message(),
                                            (folder / inside).string(), "Check its permissions"));
    }
  }
  std::ranges::sort(found.paths);
  return found;
}

Manifest make_manifest(const Take& take, const ManifestOptions& options) {
  Manifest manifest;
  manifest.take = take.document().name;
  if (has_control_characters(manifest.take)) {
    throw Error::bad_input("the take's name holds control characters", take.folder().string(),
                           "Correct \"name\" in take.json");
  }
  manifest.epoch_utc = take.document().epoch_utc;
  manifest.cameras = take.camera_count();
  const std::vector<std::string> paths = files_of_take(take.folder());
  for (const std::string& path : paths) manifest.files.push_back({path, ""});
  Hashing hashing(take.folder(), paths, options);
  tbb::parallel_for(std::size_t{0}, paths.size(), [&](std::size_t i) {
    if (!options.stop.stop_requested()) manifest.files[i].sha256 = hashing.hash(paths[i]);
  });
  if (options.stop.stop_requested()) throw stopped(take.folder());
  return manifest;
}

std::string read_manifest(const fs::path& folder) {
  const fs::path file = folder / kManifestFile;
  require_contained({folder, kManifestFile});
  if (!file_exists(file)) {
    throw Error::bad_input("the take has no manifest", file.string(),
                           "Write one while the take is known to be good");
  }
  return read_file(file, kMaxManifestBytes);
}

ManifestReport check_manifest(const fs::path& folder, std::string_view text,
                              const ManifestOptions& options) {
  ManifestReport report;
  report.manifest = parse_manifest(text, (folder / kManifestFile).string());
  const std::vector<std::string> present = files_of_take(folder);
  std::vector<std::string> listed;
  for (const Manifest::File& entry : report.manifest.files) listed.push_back(entry.path);
  std::ranges::set_difference(listed, present, std::back_inserter(report.missing));
  std::ranges::set_difference(present, listed, std::back_inserter(report.unlisted));

  const std::vector<Manifest::File>& files = report.manifest.files;
  std::vector<char> is_changed(files.size(), 0);
  Hashing hashing(folder, listed, options);
  tbb::parallel_for(std::size_t{0}, files.size(), [&](std::size_t i) {
    const bool is_missing = std::ranges::binary_search(report.missing, files[i].path);
    if (is_missing || options.stop.stop_requested()) return;
    try {
      is_changed[i] = hashing.hash(files[i].path) != files[i].sha256 ? 1 : 0;
    } catch (const Error&) {
      is_changed[i] = 1;
    }
  });
  if (options.stop.stop_requested()) throw stopped(folder);
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (is_changed[i] != 0) report.changed.push_back(files[i].path);
  }
  return report;
}

}  // namespace raystage::store
