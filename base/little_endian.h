// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cassert>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>

namespace raystage {

/// Writes `value` at `offset` of `bytes`, least significant byte first, on any machine.
template <std::integral Integer>
void store_little_endian(std::span<std::byte> bytes, std::size_t offset, Integer value) {
  assert(offset + sizeof(Integer) <= bytes.size());
  auto rest = static_cast<std::make_unsigned_t<Integer>>(value);
  for (std::size_t i = 0; i < sizeof(Integer); ++i) {
    bytes[offset + i] = static_cast<std::byte>(rest & 0xFF);
    if constexpr (sizeof(Integer) > 1) rest >>= 8;
  }
}

/// Returns the integer at `offset` of `bytes`, stored least significant byte first.
template <std::integral Integer>
Integer load_little_endian(std::span<const std::byte> bytes, std::size_t offset) {
  assert(offset + sizeof(Integer) <= bytes.size());
  std::make_unsigned_t<Integer> value = 0;
  for (std::size_t i = sizeof(Integer); i-- > 0;) {
    if constexpr (sizeof(Integer) > 1) value <<= 8;
    value |= std::to_integer<std::make_unsigned_t<Integer>>(bytes[offset + i]);
  }
  return static_cast<Integer>(value);
}

}  // namespace raystage
