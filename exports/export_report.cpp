// SPDX-License-Identifier: Apache-2.0
#include "exports/export_report.h"

#include <fmt/format.h>

#include <iterator>

namespace raystage::exports {

int ExportReport::frames() const {
  int count = 0;
  for (const Camera& camera : cameras) count += camera.frames;
  return count;
}

int ExportReport::rotten() const {
  int count = 0;
  for (const Camera& camera : cameras) count += camera.rotten;
  return count;
}

ExitCode ExportReport::exit_code() const {
  if (status != RunStatus::kFinished) return ExitCode::kFailed;
  return rotten() > 0 ? ExitCode::kFellShort : ExitCode::kSuccess;
}

void FrameCounter::add() {
  const std::size_t done = ++done_;
  if (total_ > 0) progress_(static_cast<double>(done) / static_cast<double>(total_));
}

std::string format_frame_rows(const std::vector<FrameRow>& rows, Nanoseconds epoch_utc) {
  std::string text = "camera,file,frame,time_ns,source_frame,source_time_ns,source_utc,held\n";
  for (const FrameRow& row : rows) {
    const ChosenFrame& frame = row.frame;
    fmt::format_to(std::back_inserter(text), "{},{},{},{},", row.camera, row.file, frame.number,
                   frame.time_ns);
    if (frame.source >= 0) {
      fmt::format_to(std::back_inserter(text), "{},{},{},", frame.source, frame.source_ns,
                     format_utc(epoch_utc + frame.source_ns));
    } else {
      text += ",,,";
    }
    text += frame.is_held ? "1\n" : "0\n";
  }
  return text;
}

}  // namespace raystage::exports
