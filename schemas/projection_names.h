// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "schemas/geometry.h"

namespace raystage::schemas {

/// Returns the name of a projection in documents, e.g. "ftheta".
std::string_view name_of(Projection projection);

}  // namespace raystage::schemas
