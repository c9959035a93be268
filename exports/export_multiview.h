// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <stop_token>

#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "exports/output_folder.h"
#include "store/take.h"

namespace raystage::exports {

struct MultiviewExportOptions {
  std::filesystem::path output;  ///< .mkv
  FrameChoiceOptions frames;
  ExistingFiles existing = ExistingFiles::kError;
  ExportProgress progress = [](double) {};
};

/// Writes one Matroska file with a track per camera, named by its id: the JPEG frames byte for
/// byte, at their times in ns, with rig.json and take.json attached. The file appears when it is
/// complete. Throws Error.
ExportReport export_multiview(const store::Take& take, const MultiviewExportOptions& options,
                              const std::stop_token& stop);

}  // namespace raystage::exports
