// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "store/timeline.h"

namespace raystage::store {

inline constexpr std::string_view kTimelineFile = "timeline.zst";

/// Returns the fingerprint of the inputs of a timeline: XXH3 over the epoch, and each camera's id
/// and frame table. Renaming a take or editing its colour space leaves the timeline valid; a
/// changed frame does not.
std::uint64_t take_fingerprint(const Take& take);

/// Returns the bytes of the file; layout in docs/formats/timeline.md.
std::vector<std::byte> encode_timeline(const Timeline& timeline, std::uint64_t fingerprint);

/// Returns the timeline in `file`; accepts any bytes. Memory grows with the real contents, not with
/// claimed sizes. Throws Error (bad input) if the file is damaged, of a future version, has more
/// than most_ticks(), or does not match `fingerprint` and `cameras`. Without a fingerprint the take
/// is not checked. Frame numbers are only checked to be -1 or above; times, and sums of them that
/// readers form, are within the range of Nanoseconds.
Timeline decode_timeline(std::span<const std::byte> file, std::optional<std::uint64_t> fingerprint,
                         std::size_t cameras, std::string_view name);

}  // namespace raystage::store
