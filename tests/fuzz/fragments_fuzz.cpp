// SPDX-License-Identifier: Apache-2.0
// Decodes any bytes as fragments of a view of 40x24 pixels.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "base/error.h"
#include "render/common/fragment_encoding.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr int kWidth = 40, kHeight = 24;
  constexpr raystage::render::FragmentTag kTag{1, 2, 3};
  // Guard values behind the view's, which no rectangle may change.
  constexpr std::size_t kValues = std::size_t{4} * kWidth * kHeight, kBeyond = 64;
  std::vector<float> values(kValues + kBeyond, 0.0F);
  const auto sums = std::span(values).first(kValues);
  try {
    raystage::render::add_fragments(std::as_bytes(std::span(data, size)), kTag, kWidth, kHeight,
                                    sums);
  } catch (const raystage::Error&) {
    return 0;
  }
  const auto beyond = std::span(values).last(kBeyond);
  if (std::ranges::any_of(beyond, [](float value) { return value != 0; })) std::abort();
  if (!std::ranges::all_of(sums, [](float value) { return std::isfinite(value); })) return 0;
  // Fragments that were read can be written and read again.
  raystage::render::FragmentCounts counts;
  const auto message = raystage::render::encode_fragments(kTag, sums, kWidth, kHeight, {}, counts);
  std::vector<float> again(kValues, 0.0F);
  raystage::render::add_fragments(message, kTag, kWidth, kHeight, again);
  if (!std::ranges::equal(again, sums)) std::abort();
  return 0;
}
