// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "evaluation/bench.h"

namespace raystage::reports {

/// Returns a viewer as HTML with its script, which switches between images, truth and differences
/// of the results. Returns an empty text without pictures.
std::string images_section(const evaluation::BenchResult& trade);

}  // namespace raystage::reports
