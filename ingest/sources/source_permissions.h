// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raystage::ingest {

/// What the configuration of a recording may do that most need not: it could come from a stranger.
struct SourcePermissions {
  bool filters_with_files = false;  ///< FFmpeg's filters may open files and load libraries
};

}  // namespace raystage::ingest
