// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "schemas/option_values.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// How a draft of a shot differs from it, to see it sooner or otherwise without editing it.
struct DraftOptions {
  std::string method = {};  ///< of all takes, without the shot's options; empty: the shot's
  schemas::OptionValues options = {};  ///< of the method, in addition to those of the shot
  double scale = 1;                    ///< of the picture's size, (0, 1]
  int camera_step = 1;                 ///< every n-th row and column of each take's cameras
  /// Names or numbers (from 0) of the layers to show; empty: all.
  std::vector<std::string> layers = {};
  bool is_draft() const;
};

/// Returns the shot with the differences, except `camera_step`. Layers that are not selected are
/// transparent; they stay in the list, because lights may name them. `where`: the shot file, named
/// by errors. Throws Error (bad input) for an unknown layer and a scale outside (0, 1].
schemas::ShotDocument draft_of_shot(schemas::ShotDocument shot, const DraftOptions& draft,
                                    const std::string& where);

/// Parses a scale: a number or a ratio such as "1/4", in (0, 1]. Throws Error (bad input).
double parse_scale(const std::string& text);

}  // namespace raystage::compose
