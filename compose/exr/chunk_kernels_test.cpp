// SPDX-License-Identifier: Apache-2.0
#include "compose/exr/chunk_kernels.h"

#include <gtest/gtest.h>
#include <half.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "compose/exr/memory_stream.h"

namespace raystage::compose {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// The reference of predict_chunk(), byte by byte as the OpenEXR file layout states it.
Bytes predicted_reference(const Bytes& raw) {
  Bytes sorted;
  for (std::size_t i = 0; i < raw.size(); i += 2) sorted.push_back(raw[i]);
  for (std::size_t i = 1; i < raw.size(); i += 2) sorted.push_back(raw[i]);
  Bytes predicted = sorted;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    predicted[i] = static_cast<std::uint8_t>(int{sorted[i]} - int{sorted[i - 1]} + 128 + 256);
  }
  return predicted;
}

/// Values around those where the conversion to half changes its result, and some that are no
/// number.
std::vector<float> critical_values() {
  std::vector<float> values{0.0F,
                            -0.0F,
                            65504.0F,
                            65519.9F,
                            65520.0F,
                            1e30F,
                            -65535.0F,
                            1e-30F,
                            std::numeric_limits<float>::denorm_min(),
                            std::numeric_limits<float>::infinity(),
                            -std::numeric_limits<float>::infinity(),
                            std::numeric_limits<float>::quiet_NaN(),
                            -std::numeric_limits<float>::quiet_NaN()};
  for (std::uint16_t bits = 0; bits < 0x7bff; ++bits) {
    half low, high;
    low.setBits(bits);
    high.setBits(static_cast<std::uint16_t>(bits + 1));
    const float middle = (static_cast<float>(low) + static_cast<float>(high)) / 2;
    for (const float value : {static_cast<float>(low), middle, std::nextafter(middle, 0.0F),
                              std::nextafter(middle, 1e6F)}) {
      values.push_back(value);
      values.push_back(-value);
    }
  }
  return values;
}

TEST(ChunkKernels, HalvesAreThoseOfImath) {
  const std::vector<float> values = critical_values();
  for (const std::size_t stride : {1U, 2U, 3U, 4U}) {
    std::vector<float> spread(values.size() * stride, 7.0F);
    for (std::size_t i = 0; i < values.size(); ++i) spread[i * stride] = values[i];
    Bytes bytes(2 * values.size() + 1);
    convert_to_halves(spread.data(), stride, values.size(), bytes.data() + 1);  // misaligned
    for (std::size_t i = 0; i < values.size(); ++i) {
      std::uint16_t bits = 0;
      std::memcpy(&bits, bytes.data() + 1 + 2 * i, 2);
      ASSERT_EQ(bits, clamp_to_half(values[i]).bits()) << values[i] << " stride " << stride;
    }
  }
}

TEST(ChunkKernels, FewValuesAndTheLastChannelStayWithinTheirPixels) {
  for (std::size_t count = 0; count < 40; ++count) {
    for (std::size_t channel = 0; channel < 4; ++channel) {
      std::vector<float> pixels(4 * count);  // the address sanitizer guards its end
      for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<float>(i);
      Bytes halves(2 * count), floats(4 * count);
      convert_to_halves(pixels.data() + channel, 4, count, halves.data());
      copy_without_nan(pixels.data() + channel, 4, count, 0, floats.data());
      for (std::size_t i = 0; i < count; ++i) {
        half found;
        std::uint16_t bits = 0;
        std::memcpy(&bits, halves.data() + 2 * i, 2);
        found.setBits(bits);
        float copied = 0;
        std::memcpy(&copied, floats.data() + 4 * i, 4);
        ASSERT_EQ(found, half(pixels[4 * i + channel]));
        ASSERT_EQ(copied, pixels[4 * i + channel]);
      }
    }
  }
}

TEST(ChunkKernels, FloatsAreCopiedBitByBitButForNan) {
  const std::vector<float> values = critical_values();
  Bytes bytes(4 * values.size());
  copy_without_nan(values.data(), 1, values.size(), 1e9F, bytes.data());
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, bytes.data() + 4 * i, 4);
    const float expected = std::isnan(values[i]) ? 1e9F : values[i];
    ASSERT_EQ(bits, std::bit_cast<std::uint32_t>(expected)) << values[i];
  }
}

TEST(ChunkKernels, BytesArePredictedAsTheFileLayoutStates) {
  std::mt19937 random(3);
  for (const std::size_t size :
       {0U, 1U, 2U, 3U, 31U, 32U, 33U, 63U, 64U, 65U, 127U, 129U, 1000U, 4097U}) {
    Bytes raw(size);
    for (std::uint8_t& byte : raw) byte = static_cast<std::uint8_t>(random());
    Bytes sorted(size), predicted(size);
    predict_chunk(raw, sorted, predicted);
    EXPECT_EQ(predicted, predicted_reference(raw)) << size;
  }
}

}  // namespace
}  // namespace raystage::compose
