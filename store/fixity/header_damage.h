// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "store/matroska.h"

namespace raystage {

/// Bytes of an archive that are not as they should be.
struct Damage {
  std::size_t offset = 0;  ///< of the first of them
  std::string what;
};

/// Index of the first byte that differs; the shorter length where one is the beginning of the
/// other.
std::size_t first_difference(std::span<const std::byte> a, std::span<const std::byte> b);

/// What of the archive's header differs from `header` as it is while recording, or as `closing`
/// fills it in. `claims_closed`: its size is filled in. An archive that was not closed may end
/// within its header.
std::vector<Damage> header_damage(std::span<const std::byte> archive,
                                  const matroska::Header& header, const matroska::Closing& closing,
                                  bool claims_closed);

}  // namespace raystage
