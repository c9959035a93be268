// SPDX-License-Identifier: Apache-2.0
// raystage pack: recompresses the frames of a take, without loss or as video.
#include "cli/pack.h"

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/pack_temporal.h"
#include "cli/sandbox_option.h"

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Writes a copy of a take whose JPEG frames are recompressed without loss (JPEG XL by "
      "libjxl).\n"
      "Each frame is unpacked again and compared before it counts; frames that libjxl does not\n"
      "accept stay JPEG. Every command reads packed takes, at the cost of unpacking whole frames\n"
      "(docs/archivist.md). `raystage unpack` returns the same bytes. All other files of the take\n"
      "are copied, but hidden ones and depth/; a manifest is kept in NEWTAKE/original/.\n"
      "With --temporal the frames are encoded as video, lossy: the JPEGs cannot be returned.",
      "raystage pack");
  PackCommandOptions options;
  add_pack_options(command, options);
  command
      .option("--effort", options.how.effort,
              "libjxl's effort, 1 (fast) to 9 (slow, smallest): see docs/archivist.md")
      .show_default()
      .limits(1, 9);
  add_sandbox_option(command);
  TemporalCommandOptions temporal;
  add_temporal_options(command, temporal);
  command.footer(
      "Exit codes: 0 done, also if frames stay JPEG; 1 failed; 2 bad usage or input, such as "
      "frames\n"
      "that are not as recorded; 128+n stopped by signal n. Nothing remains of a take that was "
      "not\n"
      "completed, except a hidden folder .NEWTAKE.*.tmp after kill -9 or a power loss,\n"
      "which the next run on this machine with the same -o removes.");
  return parse_and_run(command, argc, argv, "pack", [&](const std::stop_token& stop) {
    return temporal.codec.empty() ? run_pack(options, false, stop)
                                  : run_pack_temporal(options, temporal, stop);
  });
}
