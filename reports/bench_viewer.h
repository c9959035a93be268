// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "render/evaluation/bench.h"

namespace raystage {

/// HTML: pictures, truth and differences of a trade to flip between, with the script that does it;
/// empty where there are none.
std::string images_section(const BenchResult& trade);

}  // namespace raystage
