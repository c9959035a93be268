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
      "read through symbolic links inside of takes, for archives on other disks: only takes that "
      "you\ntrust (default: a link is an error; nothing is ever written through one)");
}

}  // namespace raystage::cli
