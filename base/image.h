// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace raystage {

/// An image in memory: row by row, pixel by pixel, the channels of a pixel next to each other.
/// Coordinates are signed, so that loops over neighbours need no conversion; they are not checked.
template <class T, int Channels = 1>
struct Image {
  int width = 0, height = 0;  ///< pixels
  std::vector<T> values;      ///< width x height x Channels

  Image() = default;
  Image(int columns, int rows) : width(columns), height(rows), values(offset(0, rows)) {}
  /// A template, so that `{}` means no contents and not a fill.
  template <std::convertible_to<T> Fill>
  Image(int columns, int rows, const Fill& fill)
      : width(columns), height(rows), values(offset(0, rows), static_cast<T>(fill)) {}
  /// `contents`: width x height x Channels.
  Image(int columns, int rows, std::vector<T> contents)
      : width(columns), height(rows), values(std::move(contents)) {}
  bool operator==(const Image&) const = default;

  /// Returns the offset in `values` of the first channel of pixel (x, y).
  std::size_t offset(int x, int y) const {
    return static_cast<std::size_t>((static_cast<std::ptrdiff_t>(y) * width + x) * Channels);
  }
  T& at(int x, int y, int channel = 0) { return values[offset(x, y) + channel]; }
  const T& at(int x, int y, int channel = 0) const { return values[offset(x, y) + channel]; }
  /// Returns the nearest pixel inside the image.
  const T& clamped(int x, int y, int channel = 0) const {
    return at(std::clamp(x, 0, width - 1), std::clamp(y, 0, height - 1), channel);
  }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }
  std::span<T> row(int y) { return {values.data() + offset(0, y), offset(0, 1)}; }
  std::span<const T> row(int y) const { return {values.data() + offset(0, y), offset(0, 1)}; }
  /// Returns the channels of pixel (x, y).
  std::span<T, Channels> pixel(int x, int y) {
    return std::span<T, Channels>(values.data() + offset(x, y), Channels);
  }
  std::span<const T, Channels> pixel(int x, int y) const {
    return std::span<const T, Channels>(values.data() + offset(x, y), Channels);
  }
};

}  // namespace raystage
