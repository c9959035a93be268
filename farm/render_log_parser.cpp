// SPDX-License-Identifier: Apache-2.0
// Parses the lines of SequenceReport::stages() and summary() and the renderer's failures.
// render_log_parser_test.cpp checks that the texts match.
#include "farm/render_log_parser.h"

#include "base/number_text.h"
#include "store/rotten_frame.h"

namespace raystage::farm {
namespace {

/// Returns the number that follows `label` in the line, or 0 if there is none.
double value_after(std::string_view line, std::string_view label) {
  const std::size_t at = line.find(label);
  return at == std::string_view::npos ? 0 : number_at_start<double>(line.substr(at + label.size()));
}

schemas::RenderStageCosts costs_of(std::string_view line) {
  constexpr double kSeconds = 1e-3, kBytes = 1e6;
  schemas::RenderStageCosts costs;
  costs.frames_in_flight = static_cast<int>(value_after(line, "milliseconds a frame, "));
  costs.light_fields_s = kSeconds * value_after(line, "light fields ");
  costs.geometry_s = kSeconds * value_after(line, "geometry ");
  costs.merge_s = kSeconds * value_after(line, "merging ");
  costs.encode_s = kSeconds * value_after(line, "encoding ");
  costs.write_s = kSeconds * value_after(line, "writing ");
  costs.decode_s = kSeconds * value_after(line, "decoding ");
  costs.read_bytes = kBytes * value_after(line, "of processors for ");
  return costs;
}

}  // namespace

void RenderLogParser::parse_line(std::string_view line) {
  if (line.starts_with("Progress: ")) return;
  last = line;
  // The error message of a command; mpirun prints more lines after it.
  constexpr std::string_view kCommand = "raystage ";
  const std::size_t colon = line.find(": ");
  if (line.starts_with(kCommand) && line.find(' ', kCommand.size()) == colon + 1)
    error_message = line;
  if (line.starts_with("depths of ")) {
    solved = static_cast<int>(value_after(line, "depths of "));
    read = static_cast<int>(value_after(line, "solved, of "));
  }
  if (line.starts_with("milliseconds a frame, ")) rendering = costs_of(line);
  // The last line: "48 of 48 frames rendered; 2.5 s, ...".
  if (rendering && line.find(" frames rendered") != std::string_view::npos) {
    rendering->frames = static_cast<int>(value_after(line, ""));
    rendering->seconds = value_after(line, "; ");
    if (rendering->frames == 0) rendering.reset();
  }
  constexpr std::string_view kFrame = "frame ", kFailed = " failed:";
  const std::size_t failed_at = line.find(kFailed);
  if (failed_at == std::string_view::npos) return;
  if (first_failure.empty()) first_failure = line;
  if (!line.starts_with(kFrame)) return;
  const auto frame = parse_number<int>(line.substr(kFrame.size(), failed_at - kFrame.size()));
  if (!frame) return;
  failed_frames.insert(*frame);
  if (line.find(store::kRottenFrameText) != std::string_view::npos) rotten_frames.insert(*frame);
}

}  // namespace raystage::farm
