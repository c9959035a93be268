// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "farm/cost_model.h"

namespace raystage::farm {

/// Returns the prediction as an HTML page with a chart of efficiency over nodes.
std::string cost_page(const JobCosts& job, const SiteParameters& site, std::span<const int> nodes,
                      std::string_view title);

}  // namespace raystage::farm
