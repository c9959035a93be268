// SPDX-License-Identifier: Apache-2.0
#include "store/absent_archives.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"

namespace raystage::store {
namespace {

class AbsentArchives : public RemoteArchives {
 public:
  explicit AbsentArchives(const std::filesystem::path& folder) {
    for (const auto& camera : schemas::read_take(ContainedPath{folder, "take.json"}).cameras) {
      is_absent_.push_back(!exists(ContainedPath{folder, camera.archive}));
    }
    if (std::ranges::all_of(is_absent_, std::identity())) {
      throw Error::bad_input("the archives of all cameras are missing", folder.string(),
                             "Mount the disk that holds them, or restore them from a copy");
    }
  }

  std::optional<ArchiveReader> open(int camera) const override {
    if (!is_missing(camera)) return std::nullopt;
    return ArchiveReader(ArchiveWriter::Description(), {}, nullptr);
  }

  bool is_missing(int camera) const override {
    return is_absent_.at(static_cast<std::size_t>(camera));
  }

 private:
  std::vector<bool> is_absent_;
};

}  // namespace

std::shared_ptr<const RemoteArchives> make_absent_archives(
    const std::filesystem::path& take_folder) {
  if (!file_exists(take_folder / "take.json")) return nullptr;
  return std::make_shared<const AbsentArchives>(take_folder);
}

std::string describe_missing_archives(const Take& take) {
  std::vector<std::string> missing;
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    if (take.is_missing(camera)) missing.push_back(take.document().cameras[camera].id);
  }
  if (missing.empty()) return "";
  return fmt::format(
      "{}: the archives of {} of {} cameras are missing: {}; these cameras are absent from all "
      "frames",
      take.folder().string(), missing.size(), take.camera_count(), fmt::join(missing, ", "));
}

}  // namespace raystage::store
