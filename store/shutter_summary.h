// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/rig.h"

namespace raystage::store {

/// What the rig of a take states about the shutters of its cameras.
struct ShutterSummary {
  int cameras = 0;
  int rolling = 0;  ///< cameras with a line time
  /// Of the rolling shutters; 0 without any.
  double min_line_time_us = 0, max_line_time_us = 0;
  double min_read_out_ms = 0, max_read_out_ms = 0;  ///< of a frame

  bool is_global() const { return rolling == 0; }
};

ShutterSummary summarise_shutters(const rig::Rig& rig);

}  // namespace raystage::store
