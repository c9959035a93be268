// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

#include "schemas/geometry.h"

namespace raystage::schemas {

/// Returns the name of a projection in documents, e.g. "ftheta".
std::string_view name_of(Projection projection);

/// Returns all projections, in the order of the enumerators.
std::span<const Projection> projections();

}  // namespace raystage::schemas
