// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "base/time.h"
#include "store/take.h"

namespace raystage::store {

/// Returns the mean luminance of a JPEG frame as a code of 0 to 255, or NaN if it is damaged. Uses
/// an eighth of its size (the block means: no inverse DCT, no chroma).
double mean_luminance(std::span<const std::byte> jpeg);

/// Returns the mean luminance of every frame of every camera whose time (`times[c][i]`, ns) is in
/// [begin, end], and NaN for others. `progress` receives the fraction done, in [0, 1]. Stops early,
/// with NaN for the rest, when `stop` is requested.
std::vector<std::vector<double>> measure_luminance(
    const Take& take, const std::vector<std::vector<Nanoseconds>>& times, Nanoseconds begin,
    Nanoseconds end, const std::function<void(double)>& progress, std::stop_token stop);

}  // namespace raystage::store
