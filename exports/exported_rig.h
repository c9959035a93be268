// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "schemas/import_manifest.h"
#include "schemas/rig_document.h"
#include "store/take.h"

namespace raystage::exports {

/// Returns the rig of the exported cameras, in their order.
schemas::RigDocument exported_rig(const store::Take& take, const FrameChoice& choice);

/// Returns the manifest with which `raystage import` makes a take of exported images: every written
/// frame once, at its own time stamp. `rows`: as in frames.csv. `color_space`: of the images.
schemas::ImportManifest exported_manifest(const store::Take& take, const FrameChoice& choice,
                                          const std::vector<FrameRow>& rows,
                                          const std::string& color_space);

}  // namespace raystage::exports
