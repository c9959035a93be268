// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluation/bench.h"
#include "reports/bench_charts.h"

namespace raystage::reports {

/// Returns a section as HTML with its script: parts of the views, enlarged, each as the truth and
/// every setting show it (BenchCrops::chosen()). The script shows them in one place and flips
/// between them; without it they are side by side. Returns an empty text without crops.
std::string crop_section(const evaluation::BenchResult& trade, const MethodColours& colours);

}  // namespace raystage::reports
