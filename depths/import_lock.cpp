// SPDX-License-Identifier: Apache-2.0
#include "depths/import_lock.h"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <filesystem>
#include <set>
#include <string>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "store/imported_depths.h"

namespace raystage::depths {
namespace {

namespace fs = std::filesystem;
using Document = schemas::ImportedDepthsDocument;

FileDescriptor open_depth_folder(const store::Take& take) {
  const ContainedPath folder = take.file(Document::kFolder);
  require_contained(folder);
  create_folder(folder.path());
  return open_contained(folder, O_RDONLY | O_DIRECTORY);
}

}  // namespace

ImportLock::ImportLock(const store::Take& take) : folder_(open_depth_folder(take)) {
  const std::string name = take.file(Document::kFolder).path().string();
  if (!folder_.open()) {
    throw Error::from_errno("the folder of imported depths cannot be opened", name,
                            "Check its permissions");
  }
  is_locked_ = flock(folder_.number(), LOCK_EX | LOCK_NB) == 0;
  if (!is_locked_ && errno == EWOULDBLOCK) {
    throw Error::failed("another import of depth maps into this take is running", name,
                        "Import again when it has ended");
  }
}

void ImportLock::remove_unlisted(const store::Take& take, const Document& document) const {
  if (!is_locked_) return;
  std::set<fs::path> listed;
  for (const Document::Camera& camera : document.cameras) {
    for (const Document::Map& map : camera.maps) listed.insert(map.file);
  }
  // Temporary files of maps have the same extension.
  for (const ContainedPath& file : store::imported_map_files(take)) {
    std::error_code error;
    if (listed.contains(file.relative.lexically_relative(Document::kFolder))) continue;
    if (is_contained(file)) fs::remove(file.path(), error);
  }
}

}  // namespace raystage::depths
