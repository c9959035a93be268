// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

#include "base/contained_path.h"
#include "cli/command_line.h"

namespace raystage::cli {

/// Adds --follow-links. It sets an environment variable, which processes that the command starts
/// inherit.
inline void add_follow_links_option(CommandLine& command) {
  command.flag(
      "--follow-links", [] { ::setenv(kFollowLinksVariable, "1", 1); },
      "read through symbolic links inside of takes, for archives on other disks, and textures of "
      "meshes\nfrom other folders: only takes and meshes that you trust (default: these are "
      "errors; "
      "nothing\nis ever written through a link)");
}

}  // namespace raystage::cli
