// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluation/bench.h"

namespace raystage::reports {

/// Returns the result of `raystage bench` as one self-contained HTML page: charts of error against
/// time, pictures to compare, a table.
std::string bench_as_page(const evaluation::BenchResult& trade);

}  // namespace raystage::reports
