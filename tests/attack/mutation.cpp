// SPDX-License-Identifier: Apache-2.0
#include "tests/attack/mutation.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

namespace raystage::testing {

int attack_case_count() {
  const char* const text = std::getenv("RAYSTAGE_ATTACK_CASES");
  return text == nullptr ? 25 : std::atoi(text);
}

std::string mutated_text(std::string text, std::mt19937& random) {
  const std::vector<std::string> numbers{"-1",   "0",   "4294967295", "2147483648",
                                         "1e39", "nan", "999999999",  "-2147483649"};
  const auto pick = [&](std::size_t bound) { return bound == 0 ? 0 : random() % bound; };
  for (std::size_t edits = 1 + pick(4); edits > 0 && !text.empty(); --edits) {
    const std::size_t at = pick(text.size());
    switch (pick(6)) {
      case 0:
        text[at] = static_cast<char>(random());
        break;
      case 1:
        text.resize(at);
        break;
      case 2:
        text.insert(at, text.substr(pick(text.size()), pick(64)));
        break;
      case 3:
        text.erase(at, pick(32));
        break;
      case 4:
        text.insert(at, std::string(pick(4096), text[at]));
        break;
      default: {
        const std::size_t digit = text.find_first_of("0123456789", at);
        if (digit == std::string::npos) break;
        const std::size_t end = text.find_first_not_of("0123456789.", digit);
        text.replace(digit, end == std::string::npos ? std::string::npos : end - digit,
                     numbers[pick(numbers.size())]);
      }
    }
  }
  return text;
}

std::string mutated_bytes(std::string bytes, std::mt19937& random) {
  constexpr std::array<std::uint32_t, 8> kNumbers{0,          1,          0x7fffffff, 0x80000000,
                                                  0xffffffff, 0x00010000, 0xffff0000, 0x0000ffff};
  const auto pick = [&](std::size_t bound) { return bound == 0 ? 0 : random() % bound; };
  for (std::size_t edits = 1 + pick(4); edits > 0 && !bytes.empty(); --edits) {
    constexpr std::size_t kHeader = 500;
    const std::size_t at = pick(pick(3) == 0 ? bytes.size() : std::min(bytes.size(), kHeader));
    switch (pick(6)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        bytes.insert(at, bytes.substr(pick(bytes.size()), pick(64)));
        break;
      case 2: {
        std::uint32_t number = kNumbers[pick(kNumbers.size())];
        std::memcpy(bytes.data() + at, &number, std::min(sizeof number, bytes.size() - at));
        break;
      }
      case 3:
        bytes.erase(at, 1 + pick(32));
        break;
      default:
        bytes[at] = static_cast<char>(random());
    }
  }
  return bytes;
}

}  // namespace raystage::testing
