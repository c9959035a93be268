// SPDX-License-Identifier: Apache-2.0
// raystage unpack: returns the take that was packed.
#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/pack.h"
#include "cli/sandbox_option.h"

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Writes the take that `raystage pack` was given: every frame as the JPEG that it was, bit "
      "for\n"
      "bit, checked against its XXH3. Archives, journals and other files are the same bytes "
      "again,\n"
      "if the take was recorded by this version.",
      "raystage unpack");
  PackCommandOptions options;
  add_pack_options(command, options);
  add_sandbox_option(command);
  command.footer(
      "Exit codes: 0 done; 1 failed; 2 bad usage or input, such as damaged frames (see `raystage\n"
      "verify --decode`); 128+n stopped by signal n. Nothing remains of a take that was not\n"
      "completed, except a hidden folder .NEWTAKE.*.tmp after kill -9 or a power loss,\n"
      "which the next run on this machine with the same -o removes.");
  return parse_and_run(command, argc, argv, "unpack",
                       [&](const std::stop_token& stop) { return run_pack(options, true, stop); });
}
