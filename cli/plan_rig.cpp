// SPDX-License-Identifier: Apache-2.0
#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "cli/plan.h"
#include "schemas/rig_document.h"

namespace raystage::cli {

planning::NamedRig read_named_rig(const std::filesystem::path& path) {
  const schemas::RigDocument document = is_folder(path)
                                            ? schemas::read_rig(ContainedPath{path, "rig.json"})
                                            : schemas::read_rig(path);
  return {document.name.empty() ? path.string() : document.name, rig::rig_from_document(document)};
}

}  // namespace raystage::cli
