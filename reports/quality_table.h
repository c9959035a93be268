// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluation/bench.h"
#include "reports/bench_charts.h"

namespace raystage::reports {

/// Returns a section as HTML: the errors of every setting, also in the regions of the true depths
/// if they are known. The best value of a column is marked.
std::string quality_section(const evaluation::BenchResult& trade, const MethodColours& colours);

}  // namespace raystage::reports
