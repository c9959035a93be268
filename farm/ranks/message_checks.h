// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "store/jpeg/layout.h"

// Checks of what other ranks send, before it is used.

namespace raystage::farm {

/// Returns whether bytes can be parsed as CBOR by nlohmann/json, which calls itself for each level
/// and for each string of indefinite length in another: definite lengths, no tags, and at most 16
/// levels, as messages are written. Neither counts nor strings exceed the bytes.
bool is_shallow_cbor(std::span<const std::byte> cbor);

/// Returns whether parse_jpeg_layout() could have returned the layout. Decoders index by it, and
/// allocate the bytes of its scan.
bool is_valid_layout(const store::JpegLayout& layout);

}  // namespace raystage::farm
