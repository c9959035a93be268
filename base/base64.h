// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace raystage {

/// Returns the base64 text of `bytes` (RFC 4648), with padding.
std::string encode_base64(std::span<const std::byte> bytes);

/// Returns the bytes of a base64 text, or nullopt for any other text. Padding is optional.
std::optional<std::string> decode_base64(std::string_view text);

}  // namespace raystage
