// SPDX-License-Identifier: Apache-2.0
// Compiled with the options of the kernels (raystage_kernels in cmake/House.cmake), so that Highway
// determines the same targets here as there. Data only: it is read on processors that lack the
// baseline.
#include <hwy/detect_targets.h>

#include "cli/version.h"

namespace raystage::cli {

const std::int64_t kCompiledKernelTargets = HWY_TARGETS;

}
