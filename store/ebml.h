// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace raystage::store::ebml {

/// Bytes of a size field that is filled in later. The fixed width allows patching in place (RFC
/// 8794 section 6).
inline constexpr std::size_t kSizeBytes = 8;
/// The eight-byte size field for an unknown size: the element ends with its parent.
inline constexpr std::uint64_t kUnknownSize = 0x00FF'FFFF'FFFF'FFFF;

/// Builds EBML elements in memory (RFC 8794). Identifiers are written with their marker bits, as
/// specifications list them, e.g. 0x1A45DFA3.
class Writer {
 public:
  void put_id(std::uint32_t id);
  /// Appends an eight-byte size field; `size` may be kUnknownSize.
  void put_size(std::uint64_t size);
  void put_raw(std::span<const std::byte> bytes);
  void put_big_endian(std::uint64_t value, std::size_t bytes);

  void put_uint(std::uint32_t id, std::uint64_t value);  ///< eight bytes of data
  void put_int(std::uint32_t id, std::int64_t value);    ///< eight bytes of data
  void put_float(std::uint32_t id, double value);        ///< eight bytes of data
  void put_string(std::uint32_t id, std::string_view text);
  void put_master(std::uint32_t id, const Writer& children);
  /// Appends a Void element of `total` bytes (at least 9), its header included.
  void put_void(std::size_t total);

  std::size_t size() const { return bytes_.size(); }
  std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

/// Identifier and position of an element in the bytes from which it was read.
struct Element {
  std::uint32_t id = 0;  ///< with its marker bits
  std::size_t offset = 0;
  std::size_t data_offset = 0;
  std::uint64_t size = 0;  ///< of the data; meaningless if unknown_size
  bool unknown_size = false;
  /// Returns the offset one past the data. Only for known sizes that read_whole_element has
  /// checked.
  std::size_t end() const { return data_offset + static_cast<std::size_t>(size); }
};

/// Returns the header of the element at `offset`, or nullopt if it is truncated or not valid EBML.
/// The data may extend beyond the bytes.
std::optional<Element> read_element(std::span<const std::byte> bytes, std::size_t offset);

/// Returns what read_element returns, but nullopt if the size is unknown or the data extends beyond
/// the bytes.
std::optional<Element> read_whole_element(std::span<const std::byte> bytes, std::size_t offset);

/// Calls `visit(const Element&)` for the consecutive whole children of `parent`, which must be
/// whole itself. Stops at the first child that is not whole.
template <typename Visit>
void for_each_child(std::span<const std::byte> bytes, const Element& parent, Visit&& visit) {
  const auto inside = bytes.first(parent.end());
  auto child = read_whole_element(inside, parent.data_offset);
  while (child) {
    visit(*child);
    child = read_whole_element(inside, child->end());
  }
}

/// Returns the data of a whole element as a big-endian number, or nullopt if it has more than eight
/// bytes.
std::optional<std::uint64_t> read_uint(std::span<const std::byte> bytes, const Element& element);
std::optional<std::int64_t> read_int(std::span<const std::byte> bytes, const Element& element);
std::string_view read_string(std::span<const std::byte> bytes, const Element& element);

}  // namespace raystage::store::ebml
