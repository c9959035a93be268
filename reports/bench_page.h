// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluation/bench.h"

namespace raystage {

/// Returns the result of `raystage bench` as one self-contained HTML page: charts of error against
/// time, pictures to compare, a table.
std::string bench_as_page(const BenchResult& trade);

}  // namespace raystage
