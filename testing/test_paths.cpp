// SPDX-License-Identifier: Apache-2.0
#include "testing/test_paths.h"

namespace raystage::testing {

std::filesystem::path source_folder() { return RAYSTAGE_SOURCE_DIR; }

std::filesystem::path commands_folder() { return RAYSTAGE_BIN_DIR; }

std::filesystem::path disk_faults_library() {
  return commands_folder().parent_path() / "lib/libbad_disk.so";
}

}  // namespace raystage::testing
