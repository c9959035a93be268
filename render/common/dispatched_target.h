// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace raystage {

/// The Highway target (HWY_AVX2 ...) that the kernels' own dispatch picks in this process.
std::int64_t dispatched_target();

}  // namespace raystage
