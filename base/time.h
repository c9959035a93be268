// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace raystage {

/// A time or a duration in nanoseconds. Archives count from the take's epoch; an epoch counts from
/// 1970-01-01T00:00:00Z (UTC without leap seconds), in the range of int64 until the year 2262.
using Nanoseconds = std::int64_t;

inline constexpr Nanoseconds kNanosecondsPerSecond = 1'000'000'000;
inline constexpr double kNsPerMs = 1e6, kNsPerS = 1e9;

/// The largest time in an archive: 2^53 ns, 104 days. A double holds every nanosecond up to it.
/// Also the longest time between the epochs of a take and of its archives.
inline constexpr Nanoseconds kMaxArchiveTime = Nanoseconds{1} << 53;
/// The longest time of a take's epoch from 1970: 139 years. Differences of two epochs, and sums of
/// an epoch and any time of a take or its timeline, do not overflow.
inline constexpr Nanoseconds kMaxTakeEpoch = 4'400'000'000 * kNanosecondsPerSecond;

/// Parses "2026-01-01T00:00:00Z", with up to nine decimals of a second. Throws Error (bad input)
/// if the text has another form or the time is outside the range of int64 nanoseconds.
Nanoseconds parse_utc(std::string_view text);

/// Returns the shortest text that parse_utc() parses to the same nanosecond.
std::string format_utc(Nanoseconds since_1970);

}  // namespace raystage
