// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "store/matroska.h"

namespace raystage::store {

/// A damaged part of an archive.
struct Damage {
  std::size_t offset = 0;  ///< of its first byte
  std::string what;
};

/// Returns the index of the first byte that differs, or the shorter length if one is the beginning
/// of the other.
std::size_t first_difference(std::span<const std::byte> a, std::span<const std::byte> b);

/// Returns the damaged parts of the archive's header. A part may be as in `closing` (as filled in
/// by close()). It may also be as in `header` (as during recording) if it is not filled in, or if
/// the archive is not marked closed. `is_marked_closed`: the archive's size is filled in. An
/// archive that was not closed may end within its header.
std::vector<Damage> find_header_damage(std::span<const std::byte> archive,
                                       const matroska::Header& header,
                                       const matroska::Trailer& closing, bool is_marked_closed);

}  // namespace raystage::store
