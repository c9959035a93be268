// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluation/bench.h"

namespace raystage::reports {

/// Returns the label of a row, with its cameras and threads where rows differ in them.
std::string row_name(const evaluation::BenchRow& row, const evaluation::BenchResult& trade);

}  // namespace raystage::reports
