// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "store/timeline.h"

namespace raystage {

inline constexpr std::string_view kTimelineFile = "timeline.zst";

/// What a timeline stands on: XXH3 over the epoch, and each camera's id and frame table. Renaming a
/// take or editing its colour space leaves the timeline valid; another frame does not.
std::uint64_t fingerprint_of(const Take& take);

/// The file's bytes; layout in docs/formats/timeline.md.
std::vector<std::byte> encode_timeline(const Timeline& timeline, std::uint64_t fingerprint);

/// Reads any bytes; memory grows with what they really hold, not with what they claim. Throws Error
/// (bad input): damaged, of a future version, of another take than the one with `fingerprint` and
/// `cameras`; without a fingerprint that is not checked. Frame numbers are only checked to be -1 or
/// above.
Timeline decode_timeline(std::span<const std::byte> file, std::optional<std::uint64_t> fingerprint,
                         std::size_t cameras, std::string_view name);

}  // namespace raystage
