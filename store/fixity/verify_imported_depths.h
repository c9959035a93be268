// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "store/fixity/verify.h"

namespace raystage::store {

/// Returns the problems of the depth maps that were imported into a take
/// (docs/formats/depth.md): each listed file must exist and, unless only sizes are compared, have
/// the XXH3-64 that its name states. Ends early at a stop.
std::vector<FixityProblem> verify_imported_depths(const Take& take,
                                                  const TakeVerifyOptions& options);

}  // namespace raystage::store
