// SPDX-License-Identifier: Apache-2.0
// raystage export: writes takes and rigs for other programs.
#include "cli/export.h"

#include <vector>

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command("Writes what Raystage records for other programs.", "raystage export");
  const std::vector<Subcommand> subcommands{
      declare_export_movies(command),    declare_export_images(command),
      declare_export_mosaic(command),    declare_export_quilt(command),
      declare_export_multiview(command), declare_export_model(command),
      declare_export_rig(command),       declare_export_depth(command)};
  command.footer(
      "Exit codes: 0 written; 1 failed; 2 bad usage or input; 4 written, but stored frames that "
      "are "
      "not as\nthey were recorded are absent.");
  return parse_and_run(command, argc, argv, "export", subcommands, {});
}
