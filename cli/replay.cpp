// SPDX-License-Identifier: Apache-2.0
// raystage replay: serves the viewer to a browser.
#include <fmt/format.h>

#include <cstdint>
#include <cstdio>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/depth_range_hint.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/sandbox_option.h"
#include "raystage_version.h"
#include "replay/viewer.h"

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command(
      "Shows a take, a shot or a folder of these in the browser: fly the camera, click to focus,\n"
      "play, set keys, save the shot. A take that is being recorded is shown live. Prints the\n"
      "address to open and serves until it is stopped (Ctrl-C).",
      "raystage replay");
  replay::ViewerOptions options;
  command
      .option("TARGET", options.target,
              "a take's folder, a shot's .json file, or a folder of takes and\nshots")
      .required();
  int port = 0;
  double memory_gb = 0;
  command
      .option("--listen", options.server.address,
              "address to listen at (default: 127.0.0.1, this machine only).\nEveryone who can "
              "reach it and knows the printed address can read takes and write shots")
      .help_text("ADDRESS");
  command.option(
      "--host-name NAME", options.server.host_names,
      "name of this machine in the browser's address bar, with --listen; may be repeated");
  command.option("--port N", port, "port to listen at (default: any free one)").range(1, 65535);
  command.option("--shots FOLDER", options.shot_folder,
                 "folder in which shots are opened and saved (default: that of TARGET)");
  command.option("--cache FOLDER", options.cache_folder,
                 "keep estimated depths in FOLDER and not in the take, which may be read-only");
  command
      .option("--memory GB", memory_gb,
              "memory for decoded frames and results, 10^9 bytes (default: half of what is free)")
      .range(0.1, 100000.0);
  command.option("-j,--threads N", options.threads, "threads of the renderer (default: all)")
      .range(1, 1024);
  add_follow_links_option(command);
  add_sandbox_option(command);
  command.option("--max-viewers N", options.server.max_clients, "pages at once (default: 32)")
      .range(1, 1000);
  return parse_and_run(
      command, argc, argv, "replay",
      [&](std::stop_token stop) {
        options.server.port = static_cast<std::uint16_t>(port);
        options.memory_bytes = static_cast<std::size_t>(memory_gb * 1e9);
        options.program_version = "raystage " RAYSTAGE_VERSION;
        replay::Viewer viewer(options);
        print("Open {}\n", viewer.url());
        print_depth_range_hint(options.target);
        std::fflush(stdout);
        viewer.run(stop);
        return ExitCode::kSuccess;
      },
      OnSignal::kEnd);
}
