// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "base/resources.h"
#include "compose/frame_range.h"
#include "compose/sequence.h"
#include "compose/sequence_memory_plan.h"

namespace raystage::compose {

ExitCode SequenceReport::exit_code() const {
  if (rendered + skipped == requested && requested > 0) {
    const bool fell_short = !frames_below_coverage.empty() || !frames_with_rot.empty();
    return fell_short ? ExitCode::kFellShort : ExitCode::kSuccess;
  }
  if (status != RunStatus::kFinished) return ExitCode::kFailed;
  if (rendered + skipped == 0) {
    const bool is_bad_input =
        !failures.empty() && std::ranges::all_of(failures, &Failure::is_bad_input);
    return is_bad_input ? ExitCode::kBadInput : ExitCode::kFailed;
  }
  return ExitCode::kSomeFramesFailed;
}

std::string SequenceReport::summary() const {
  std::string text = fmt::format("{} of {} frames rendered", rendered, requested);
  if (skipped > 0) text += fmt::format(", {} existed already", skipped);
  if (!failures.empty()) {
    std::vector<int> frames;
    for (const Failure& failure : failures) frames.push_back(failure.frame);
    text += fmt::format(", {} failed ({})", failures.size(), format_frame_range(frames));
  }
  if (!frames_below_coverage.empty()) {
    text += fmt::format(", {} below the least coverage ({})", frames_below_coverage.size(),
                        format_frame_range(frames_below_coverage));
  }
  if (!frames_with_rot.empty()) {
    text += fmt::format(", {} without cameras whose stored frames were rotten ({})",
                        frames_with_rot.size(), format_frame_range(frames_with_rot));
  }
  if (status == RunStatus::kStopped) text += ", stopped early";
  text += fmt::format("; {:.1f} s", seconds);
  if (rendered > 0 && seconds > 0) text += fmt::format(", {:.2f} frames/s", rendered / seconds);
  return text + fmt::format("; {:.1f} Mpixel decoded, {} written, peak memory {}",
                            pixels_decoded * 1e-6, format_byte_size(bytes_written),
                            format_byte_size(peak_memory()));
}

std::string SequenceReport::stages() const {
  const auto of_frame = [&](double ms) { return ms / std::max(rendered, 1); };
  const StageTimes& ms = milliseconds;
  std::string text = fmt::format(
      "milliseconds a frame, {} at once: light fields {:.1f}, geometry {:.1f}, merging {:.1f}, "
      "encoding {:.1f}; next to them writing {:.1f}; decoding {:.1f} of processors for {:.3f} MB "
      "of JPEG",
      frames_in_flight, of_frame(ms.light_fields), of_frame(ms.geometry), of_frame(ms.merge),
      of_frame(ms.encode), of_frame(ms.write), of_frame(1e3 * decoding.seconds),
      of_frame(1e-6 * decoding.jpeg_bytes));
  if (of_frame(ms.write_wait) >= 10) {
    text += fmt::format("; frames waited {:.0f} for the disk", of_frame(ms.write_wait));
  }
  return text;
}

}  // namespace raystage::compose
