// SPDX-License-Identifier: Apache-2.0
#include "store/packing/whole_archives.h"

#include <algorithm>

#include "base/error.h"
#include "store/lost_frames.h"

namespace raystage::store {

void require_whole_archive(const ArchiveReader& archive, const std::string& camera_id,
                           const std::filesystem::path& take_folder) {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input("the archive of camera \"" + camera_id + "\" " + what,
                            take_folder.string(), "Run `raystage repair` on the take first");
  };
  if (std::ranges::any_of(archive.frames(),
                          [&](const FrameRecord& frame) { return is_lost(archive, frame); })) {
    throw refuse("is shorter than when it was closed: frames are lost");
  }
  if (!archive.was_closed()) throw refuse("is not closed");
  if (archive.recovered_frames() > 0 || archive.damaged_records() > 0) {
    throw refuse("and its journal do not agree");
  }
}

}  // namespace raystage::store
