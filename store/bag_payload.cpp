// SPDX-License-Identifier: Apache-2.0
#include "store/bag_payload.h"

#include "base/atomic_file.h"
#include "base/error.h"

namespace raystage::store {

namespace fs = std::filesystem;

bool is_bag_payload(const fs::path& take) {
  const fs::path folder = (fs::absolute(take) / "").lexically_normal().parent_path();
  return folder.filename() == "data" && file_exists(folder.parent_path() / "bagit.txt");
}

void require_no_bag_payload(const fs::path& take) {
  if (!is_bag_payload(take)) return;
  throw Error::bad_input(
      "the take is the payload of a bag, which this would make invalid", take.string(),
      "Copy the folder, change the copy, and make a bag of it with `raystage bag`");
}

}  // namespace raystage::store
