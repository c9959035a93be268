// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "schemas/time.h"
#include "store/take.h"

namespace raystage {

/// When `raystage record` started anew on each camera (`--resume`), ns since the take's epoch,
/// increasing; its first start is none. From the accounts in TAKE/recording; none where there is no
/// account. Throws Error (bad input) for an account that cannot be read.
std::vector<std::vector<Nanoseconds>> recorder_restarts(const Take& take);

}  // namespace raystage
