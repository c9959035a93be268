// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "planning/shot_check.h"

namespace raystage::planning {

/// Returns one line for people: the worst of all frames.
std::string shot_check_verdict(const ShotCheck& check);
/// Returns the result as text: some lines for each take.
std::string format_shot_check(const ShotCheck& check);
/// Returns an object with the schema raystage/shot_check/1.
std::string shot_check_as_json(const ShotCheck& check);
/// Returns a page with strip charts over the frames.
std::string shot_check_as_page(const ShotCheck& check);

}  // namespace raystage::planning
