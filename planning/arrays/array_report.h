// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "planning/arrays/array_plan.h"
#include "planning/arrays/array_trial.h"

namespace raystage::planning {

/// Returns the plan and its trials for people, as JSON, or as one self-contained HTML page.
std::string format_array_plan(const ArrayPlan& plan, const std::vector<ArrayTrial>& trials);
std::string array_plan_as_json(const ArrayPlan& plan, const std::vector<ArrayTrial>& trials);
std::string array_plan_as_page(const ArrayPlan& plan, const std::vector<ArrayTrial>& trials);

}  // namespace raystage::planning
