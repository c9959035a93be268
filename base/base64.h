// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace raystage {

/// RFC 4648, with padding.
std::string encode_base64(std::span<const std::byte> bytes);

/// The bytes that encode_base64 text stands for, its padding present or not; none for any other
/// text.
std::optional<std::string> decode_base64(std::string_view text);

}  // namespace raystage
