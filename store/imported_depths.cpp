// SPDX-License-Identifier: Apache-2.0
#include "store/imported_depths.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <filesystem>
#include <string>
#include <system_error>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/mapped_file.h"

namespace raystage::store {

namespace fs = std::filesystem;
using Document = schemas::ImportedDepthsDocument;

Document read_imported_depths(const Take& take) {
  const ContainedPath file = take.file(Document::kFile);
  if (exists(file)) return schemas::parse_imported_depths(read_file(file), file.path().string());
  // Without the list the depths would be estimated, and nothing would say that maps were lost.
  if (imported_map_files(take).empty()) return {};
  throw Error::bad_input("the list of the imported depth maps is missing", file.path().string(),
                         "Restore the file from a copy (`raystage repair TAKE --from COPY`), or "
                         "delete the folder imported_depth and import the depth maps again");
}

std::vector<ContainedPath> imported_map_files(const Take& take) {
  std::vector<ContainedPath> files;
  if (!is_folder(take.folder() / Document::kFolder)) return files;
  for (const auto& camera : take.document().cameras) {
    const ContainedPath folder = take.file(fs::path(Document::kFolder) / camera.id);
    if (!is_contained(folder)) continue;
    std::error_code error;
    for (fs::directory_iterator entry(folder.path(), error), end; !error && entry != end;
         entry.increment(error)) {
      const fs::path file = fs::path(camera.id) / entry->path().filename();
      std::error_code unknown;
      if (file.extension() != ".zst") continue;
      if (entry->symlink_status(unknown).type() != fs::file_type::regular) continue;
      files.push_back({take.folder(), fs::path(Document::kFolder) / file});
    }
  }
  return files;
}

bool has_stated_hash(const ContainedPath& map_file,
                     const std::function<void(std::uint64_t)>& before_read) {
  const MappedFile file(map_file);
  if (before_read) before_read(file.bytes().size());
  file.expect(MappedFile::Access::kSequential);
  const std::uint64_t hash =
      read_mapped([&] { return XXH3_64bits(file.bytes().data(), file.bytes().size()); }, file);
  // CAMERA/FRAME.HASH.zst
  return map_file.path().stem().extension().string() == fmt::format(".{:016x}", hash);
}

}  // namespace raystage::store
