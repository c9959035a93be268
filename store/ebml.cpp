// SPDX-License-Identifier: Apache-2.0
#include "store/ebml.h"

#include <bit>
#include <cassert>

namespace raystage::store::ebml {
namespace {

constexpr std::uint32_t kVoidId = 0xEC;
constexpr std::size_t kMaxIdBytes = 4;

std::uint8_t at(std::span<const std::byte> bytes, std::size_t offset) {
  return std::to_integer<std::uint8_t>(bytes[offset]);
}

// Returns the length of a variable-size integer from its first byte; 9 if the byte is 0.
std::size_t vint_length(std::uint8_t first) {
  return static_cast<std::size_t>(std::countl_zero(first)) + 1;
}

}  // namespace

void Writer::put_big_endian(std::uint64_t value, std::size_t bytes) {
  for (std::size_t i = bytes; i-- > 0;) {
    bytes_.push_back(static_cast<std::byte>((value >> (8 * i)) & 0xFF));
  }
}

void Writer::put_id(std::uint32_t id) {
  const auto bytes = static_cast<std::size_t>(4 - std::countl_zero(id) / 8);
  put_big_endian(id, bytes);
}

void Writer::put_size(std::uint64_t size) {
  assert(size <= kUnknownSize);
  put_big_endian(size | (std::uint64_t{1} << 56), kSizeBytes);
}

void Writer::put_raw(std::span<const std::byte> bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

void Writer::put_uint(std::uint32_t id, std::uint64_t value) {
  put_id(id);
  bytes_.push_back(std::byte{0x88});
  put_big_endian(value, 8);
}

void Writer::put_int(std::uint32_t id, std::int64_t value) {
  put_uint(id, std::bit_cast<std::uint64_t>(value));
}

void Writer::put_float(std::uint32_t id, double value) {
  put_uint(id, std::bit_cast<std::uint64_t>(value));
}

void Writer::put_string(std::uint32_t id, std::string_view text) {
  put_id(id);
  put_size(text.size());
  put_raw(std::as_bytes(std::span(text)));
}

void Writer::put_master(std::uint32_t id, const Writer& children) {
  put_id(id);
  put_size(children.size());
  put_raw(children.bytes());
}

void Writer::put_void(std::size_t total) {
  constexpr std::size_t kHeader = 1 + kSizeBytes;
  assert(total >= kHeader);
  put_id(kVoidId);
  put_size(total - kHeader);
  bytes_.resize(bytes_.size() + total - kHeader);
}

std::optional<Element> read_element(std::span<const std::byte> bytes, std::size_t offset) {
  if (offset >= bytes.size()) return std::nullopt;
  const std::size_t id_bytes = vint_length(at(bytes, offset));
  if (id_bytes > kMaxIdBytes || bytes.size() - offset <= id_bytes) return std::nullopt;
  Element element;
  element.offset = offset;
  for (std::size_t i = 0; i < id_bytes; ++i) {
    element.id = (element.id << 8) | at(bytes, offset + i);
  }
  const std::size_t size_offset = offset + id_bytes;
  const std::size_t size_bytes = vint_length(at(bytes, size_offset));
  if (size_bytes > kSizeBytes || bytes.size() - size_offset < size_bytes) return std::nullopt;
  std::uint64_t size = at(bytes, size_offset) & ((1u << (8 - size_bytes)) - 1);
  for (std::size_t i = 1; i < size_bytes; ++i) size = (size << 8) | at(bytes, size_offset + i);
  element.size = size;
  element.unknown_size = size == (std::uint64_t{1} << (7 * size_bytes)) - 1;
  element.data_offset = size_offset + size_bytes;
  return element;
}

std::optional<Element> read_whole_element(std::span<const std::byte> bytes, std::size_t offset) {
  const auto element = read_element(bytes, offset);
  if (!element || element->unknown_size || element->size > bytes.size() - element->data_offset) {
    return std::nullopt;
  }
  return element;
}

std::optional<std::uint64_t> read_uint(std::span<const std::byte> bytes, const Element& element) {
  if (element.size > 8) return std::nullopt;
  std::uint64_t value = 0;
  for (std::size_t i = element.data_offset; i < element.end(); ++i) {
    value = (value << 8) | at(bytes, i);
  }
  return value;
}

std::optional<std::int64_t> read_int(std::span<const std::byte> bytes, const Element& element) {
  const auto value = read_uint(bytes, element);
  if (!value) return std::nullopt;
  if (element.size == 0) return 0;
  const auto unused_bits = static_cast<int>(64 - 8 * element.size);
  return std::bit_cast<std::int64_t>(*value << unused_bits) >> unused_bits;
}

std::string_view read_string(std::span<const std::byte> bytes, const Element& element) {
  const auto data = bytes.subspan(element.data_offset, static_cast<std::size_t>(element.size));
  // char may alias std::byte. EBML strings may be padded with zeros.
  const std::string_view text(reinterpret_cast<const char*>(data.data()), data.size());
  return text.substr(0, text.find('\0'));
}

}  // namespace raystage::store::ebml
