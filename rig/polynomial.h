// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

namespace raystage::rig {

/// A polynomial up to the eighth power, constant term first.
using Polynomial = std::array<double, 9>;

/// Returns the increasing numbers in (0, limit) at which `p` changes sign, to adjacent doubles.
std::vector<double> sign_changes(const Polynomial& p, double limit);

}  // namespace raystage::rig
