// SPDX-License-Identifier: Apache-2.0
// Options that the exports of takes share.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli/command_line.h"
#include "exports/export_report.h"
#include "exports/frame_choice.h"
#include "exports/output_folder.h"
#include "store/take.h"

namespace raystage::cli {

/// The values of the options; they must outlive parsing.
struct ExportOptions {
  std::filesystem::path take, output;
  std::vector<std::string> cameras;
  std::string frames;
  std::optional<double> from_s, to_s;
  std::string times, absent;
  std::string default_absent;  ///< that of --absent
  double fps = 0;
  std::string origin = "epoch";
  bool missing_archives = false;  ///< are accepted: the cameras are absent
  bool overwrites = false;
  int threads = 0;
  bool quiet = false;
};

/// How an export chooses its times.
enum class OfferedTimes {
  kAll,       ///< --times recorded|synchronised|constant, by default recorded
  kImages,    ///< the same, by default constant; absent frames may leave a gap
  kConstant,  ///< only --fps and --absent
  kOne        ///< none: the export has one instant
};

/// Adds TAKE, -o, --cameras, --missing-archives and --follow-links. `output_help`: of -o, named
/// `output_name`.
void add_take_options(CommandLine& command, ExportOptions& options, const std::string& output_name,
                      const std::string& output_help);
/// Opens the take. Reports cameras whose archives are missing, where that is accepted.
store::Take open_take(const ExportOptions& options);
/// Adds --frames, --from, --to, and those of the times. `absent`: the default of --absent.
void add_frame_options(CommandLine& command, ExportOptions& options, OfferedTimes times,
                       const std::string& absent);
/// Adds --existing error|overwrite.
void add_existing_option(CommandLine& command, ExportOptions& options);
/// Adds --threads and --quiet.
void add_run_options(CommandLine& command, ExportOptions& options);

/// Returns the choice of frames. Throws Error (bad input) for a malformed range of frames.
exports::FrameChoiceOptions frame_choice(const ExportOptions& options);
inline exports::ExistingFiles existing_files(const ExportOptions& options) {
  return options.overwrites ? exports::ExistingFiles::kOverwrite : exports::ExistingFiles::kError;
}

/// Prints the lines of a report: notes, frames that lack, and what was written.
void print_report(const exports::ExportReport& report, const std::string& output,
                  const std::string& what);

}  // namespace raystage::cli
