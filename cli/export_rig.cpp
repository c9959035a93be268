// SPDX-License-Identifier: Apache-2.0
// raystage export rig: writes cameras with poses and lenses in the format of another program.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "cli/export.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "ingest/rig_formats/rig_format.h"
#include "schemas/rig_document.h"

namespace raystage::cli {
namespace {

struct RigExport {
  std::filesystem::path rig, output;
  std::string format;
};

/// Throws Error (bad input) if a file would replace the rig.
void check_not_the_rig(const std::filesystem::path& file, const std::filesystem::path& rig) {
  std::error_code ignored;
  if (!std::filesystem::equivalent(file, is_folder(rig) ? rig / "rig.json" : rig, ignored)) return;
  throw Error::bad_input("the file would replace the rig that it is made of", file.string(),
                         "Give another file");
}

ExitCode export_rig(const RigExport& options) {
  const ingest::RigFormat& format = ingest::rig_format(options.format);
  const schemas::RigDocument rig = is_folder(options.rig)
                                       ? schemas::read_rig(ContainedPath{options.rig, "rig.json"})
                                       : schemas::read_rig(options.rig);
  const ingest::ExportedRig exported = format.format(rig);
  const bool one_file = exported.files.size() == 1;
  if (!one_file) create_folder(options.output);
  const auto path_of = [&](const ingest::NamedText& file) {
    return one_file ? options.output : options.output / file.name;
  };
  for (const ingest::NamedText& file : exported.files)
    check_not_the_rig(path_of(file), options.rig);
  for (const ingest::NamedText& file : exported.files) {
    write_file_atomically(path_of(file), file.text);
  }
  for (const std::string& note : exported.notes) print_error("note: {}\n", note);
  print("{}: {} cameras, {}\n", options.output.string(), rig.cameras.size(), format.description());
  return ExitCode::kSuccess;
}

}  // namespace

Subcommand declare_export_rig(CommandLine& command) {
  auto options = std::make_shared<RigExport>();
  CommandLine rig = command.subcommand(
      "rig",
      "Write the cameras of an array, with poses and lenses, in the format of another program");
  rig.option("RIG|TAKE", options->rig, "the rig (rig.json), or a take").required();
  std::vector<std::string> names;
  std::string formats;
  for (const ingest::RigFormat* format : ingest::rig_formats()) {
    names.emplace_back(format->name());
    formats += fmt::format("\n{}: {}", format->name(), format->description());
  }
  rig.option("--format FORMAT", options->format, "format of the files:" + formats)
      .one_of_listed(names)
      .required();
  rig.option("-o,--output FILE|FOLDER", options->output,
             "file to write; of colmap the folder of its files")
      .required();
  add_follow_links_option(rig);
  return {rig, [options](const std::stop_token&) { return export_rig(*options); }};
}

}  // namespace raystage::cli
