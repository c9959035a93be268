// SPDX-License-Identifier: Apache-2.0
// What an export wrote, and the table of its frames.
#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/run_status.h"
#include "exports/frame_choice.h"
#include "store/take.h"

namespace raystage::exports {

struct ExportReport {
  struct Camera {
    std::string id;
    int frames = 0;   ///< written
    int held = 0;     ///< of these, earlier or later frames that stand for absent ones
    int black = 0;    ///< of `frames`, black ones that stand for absent ones
    int absent = 0;   ///< as CameraFrames::absent
    int rotten = 0;   ///< stored frames that are not as they were recorded (XXH3): absent
    int clipped = 0;  ///< of `frames`, those of more than 8 bits, written with 8, clipped at white
  };
  std::vector<Camera> cameras;
  double fps = 0;                  ///< as FrameChoice
  Nanoseconds origin_ns = 0;       ///< as FrameChoice
  std::vector<std::string> notes;  ///< sentences
  RunStatus status = RunStatus::kNotRun;

  int frames() const;
  int rotten() const;
  /// Returns kSuccess, or kFellShort if stored frames were not as recorded.
  ExitCode exit_code() const;
};

/// Called with values that rise from 0 to 1, from many threads.
using ExportProgress = std::function<void(double)>;

/// Counts finished frames over all cameras.
class FrameCounter {
 public:
  FrameCounter(std::size_t total, const ExportProgress& progress)
      : total_(total), progress_(progress) {}
  void add();

 private:
  std::size_t total_;
  const ExportProgress& progress_;
  std::atomic<std::size_t> done_ = 0;
};

/// A row of frames.csv (docs/formats/exports.md).
struct FrameRow {
  std::string camera, file;
  ChosenFrame frame;
};

/// Returns frames.csv: a line per written frame. `epoch_utc`: of the take.
std::string format_frame_rows(const std::vector<FrameRow>& rows, Nanoseconds epoch_utc);

}  // namespace raystage::exports
