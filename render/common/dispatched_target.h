// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace raystage::render {

/// Returns the Highway target (HWY_AVX2 ...) that the kernels' dispatch selects in this process.
std::int64_t dispatched_target();

}  // namespace raystage::render
