// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

namespace raystage::sandbox {

/// Appends values as this machine stores them: a decoder and its parent run on the same one.
class ByteWriter {
 public:
  template <class T>
  requires std::is_arithmetic_v<T>
  void write(const T& value) {
    const auto* const bytes = reinterpret_cast<const std::byte*>(&value);
    bytes_.insert(bytes_.end(), bytes, bytes + sizeof value);
  }
  template <class T, std::size_t kSize>
  void write(const std::array<T, kSize>& values) {
    for (const T& value : values) write(value);
  }
  /// Of a vector or text of plain values: their number, then they.
  template <class Container>
  void write_plain(const Container& values) {
    write(std::uint64_t{values.size()});
    const auto* const bytes = reinterpret_cast<const std::byte*>(values.data());
    bytes_.insert(bytes_.end(), bytes, bytes + values.size() * sizeof(values[0]));
  }
  /// Without their number, for ByteReader::read_rest().
  void append(std::span<const std::byte> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

/// Reads what ByteWriter wrote. Throws std::runtime_error if bytes are missing: they may come from
/// a decoder that a hostile file has taken over.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <class T>
  requires std::is_arithmetic_v<T>
  void read(T& value) {
    require(bytes_.size() >= sizeof value);
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_ = bytes_.subspan(sizeof value);
  }
  template <class T>
  T read() {
    T value{};
    read(value);
    return value;
  }
  template <class T, std::size_t kSize>
  void read(std::array<T, kSize>& values) {
    for (T& value : values) read(value);
  }
  template <class Container>
  void read_plain(Container& values) {
    values.resize(read_count(sizeof(values[0])));
    const std::size_t size = values.size() * sizeof(values[0]);
    if (size > 0) std::memcpy(values.data(), bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
  }
  /// `least_size`: of one element, bytes; so many must follow.
  std::size_t read_count(std::size_t least_size) {
    const auto count = read<std::uint64_t>();
    require(count <= bytes_.size() / least_size);
    return static_cast<std::size_t>(count);
  }
  bool read_flag() { return read<std::uint8_t>() != 0; }
  /// Returns what is left, which counts as read.
  std::span<const std::byte> read_rest() { return std::exchange(bytes_, {}); }
  bool is_at_end() const { return bytes_.empty(); }
  static void require(bool holds) {
    if (!holds) throw std::runtime_error("its decoder returned damaged data");
  }

 private:
  std::span<const std::byte> bytes_;
};

}  // namespace raystage::sandbox
