// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "base/time.h"
#include "store/take.h"

namespace raystage {

/// Mean luminance of a JPEG frame, codes of 255, from an eighth of its size (the means of its
/// blocks: no inverse DCT, no chroma). NaN where it is damaged.
double mean_luminance(std::span<const std::byte> jpeg);

/// That of every frame of every camera whose time (`times[c][i]`, ns) lies in [begin, end]; NaN for
/// others. `progress` gets the part done, in [0, 1]. Ends early, with NaN, when a stop is asked
/// for.
std::vector<std::vector<double>> luminance_of(const Take& take,
                                              const std::vector<std::vector<Nanoseconds>>& times,
                                              Nanoseconds begin, Nanoseconds end,
                                              const std::function<void(double)>& progress,
                                              std::stop_token stop);

}  // namespace raystage
