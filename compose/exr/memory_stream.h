// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenEXR/ImfIO.h>
#include <half.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

namespace raystage::compose {

/// OpenEXR's threads are off: frames are already processed in parallel.
inline constexpr int kNoExrThreads = 0;

/// Collects an EXR file in memory. OpenEXR's file writer ignores a full disk when it closes a file.
class MemoryStream final : public Imf::OStream {
 public:
  MemoryStream() : Imf::OStream("memory") {}
  void write(const char c[], int n) override {
    const auto count = static_cast<std::size_t>(n);
    if (at_ + count > bytes_.size()) bytes_.resize(at_ + count);
    std::memcpy(bytes_.data() + at_, c, count);
    at_ += count;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }

  std::vector<std::byte> take() {
    bytes_.shrink_to_fit();  // the file may wait for the disk
    return std::move(bytes_);
  }
  void reserve(std::size_t size) { bytes_.reserve(size); }

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
};

/// Returns the value clamped to +-65504, the range of half; 0 for NaN.
inline half clamp_to_half(float value) {
  constexpr float kLargest = 65504.0F;  // of half
  if (std::isnan(value)) return half(0.0F);
  return half(std::clamp(value, -kLargest, kLargest));
}

}  // namespace raystage::compose
