// SPDX-License-Identifier: Apache-2.0
#include "store/packing/copy_files.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/posix_file.h"
#include "schemas/take_document.h"
#include "store/fixity/event_log.h"
#include "store/fixity/manifest.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
constexpr const char* kOriginal = "original";  // folder of a packed take

void copy_file(const ContainedPath& from, const fs::path& to) {
  constexpr std::size_t kPart = std::size_t{1} << 20;
  create_folder(to.parent_path());
  const InputFile source(from);
  OutputFile target(to);
  std::vector<std::byte> part(kPart);
  for (std::uint64_t offset = 0; offset < source.size();) {
    const auto wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(kPart, source.size() - offset));
    const std::span<std::byte> bytes = std::span(part).first(wanted);
    if (source.read_at(offset, bytes) != wanted) {
      throw Error::failed("the file cannot be read", from.path().string(), "Check the disk");
    }
    if (!target.write_at(offset, bytes)) {
      throw Error::from_errno("the file cannot be written", to.string(), "Free space on the disk");
    }
    offset += wanted;
  }
}

bool is_regular(const ContainedPath& file) {
  std::error_code error;
  return is_contained(file) && fs::is_regular_file(fs::symlink_status(file.path(), error));
}

/// Whether the archives of two documents have the same names and epochs.
bool has_same_archives(const schemas::TakeDocument& a, const schemas::TakeDocument& b) {
  return std::ranges::equal(a.cameras, b.cameras, [](const auto& x, const auto& y) {
    return x.archive == y.archive && x.journal == y.journal &&
           x.archive_epoch_utc == y.archive_epoch_utc;
  });
}

}  // namespace

void copy_other_files(const fs::path& from, const fs::path& to, Direction direction) {
  const schemas::TakeDocument document = schemas::read_take(ContainedPath{from, "take.json"});
  std::set<std::string> written{"take.json", "rig.json"};
  for (const auto& camera : document.cameras) {
    written.insert(camera.archive);
    written.insert(camera.journal);
  }
  if (has_same_archives(document, schemas::read_take(to / "take.json"))) {
    for (const char* name : {"take.json", "rig.json"}) {
      write_file_atomically(to / name, read_file(ContainedPath{from, name}));
    }
  }
  const fs::path original(kOriginal);
  std::vector<std::pair<fs::path, fs::path>> unlisted;  // source and target
  // A take that is packed again keeps the manifest of its unpacked form.
  const bool has_original = is_regular({from, original / kManifestFile});
  for (const char* name : {kManifestFile, kSignatureFile}) {
    if (direction == Direction::kPack)
      unlisted.emplace_back(has_original ? original / name : name, original / name);
    if (direction == Direction::kUnpack) unlisted.emplace_back(original / name, name);
    written.insert((original / name).string());
  }
  for (const std::string& path : files_of_take(from)) {
    if (!written.contains(path)) copy_file({from, path}, to / path);
  }
  unlisted.emplace_back(kEventLogFile, kEventLogFile);  // the history of both forms
  for (const auto& [source, target] : unlisted) {
    if (is_regular({from, source})) copy_file({from, source}, to / target);
  }
}

}  // namespace raystage::store
