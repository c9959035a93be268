// SPDX-License-Identifier: Apache-2.0
#include "tests/attack/mutation.h"

#include <arpa/inet.h>

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

namespace {

/// Returns the boxes of an ISO base media file, each with its header. The last one ends with the
/// file.
std::vector<std::string> boxes_of(const std::string& file) {
  std::vector<std::string> boxes;
  for (std::size_t at = 0; at < file.size();) {
    constexpr std::size_t kHeader = 8;
    std::uint32_t size = 0;
    if (file.size() - at >= kHeader) std::memcpy(&size, file.data() + at, sizeof size);
    std::size_t bytes = ntohl(size);
    if (bytes < kHeader || bytes > file.size() - at) bytes = file.size() - at;
    boxes.push_back(file.substr(at, bytes));
    at += bytes;
  }
  return boxes;
}

void change_box(std::string& box, std::mt19937& random) {
  constexpr std::size_t kType = 4, kHeader = 8;
  constexpr std::array<std::uint32_t, 7> kSizes{0, 1, 7, 8, 0x7fffffff, 0x80000000, 0xffffffff};
  if (box.size() <= kHeader) return;
  switch (random() % 4) {
    case 0: {
      const std::uint32_t size = htonl(kSizes[random() % kSizes.size()]);
      std::memcpy(box.data(), &size, sizeof size);
      break;
    }
    case 1:
      box[kType + random() % 4] = static_cast<char>(random());
      break;
    default:  // with the size that the change leaves
      box = box.substr(0, kHeader) + mutated_bytes(box.substr(kHeader), random);
      const std::uint32_t size = htonl(static_cast<std::uint32_t>(box.size()));
      std::memcpy(box.data(), &size, sizeof size);
  }
}

}  // namespace

std::string mutated_packed_frame(const std::string& frame, std::mt19937& random) {
  std::vector<std::string> boxes = boxes_of(frame);
  for (std::size_t edits = 1 + random() % 4; edits > 0 && !boxes.empty(); --edits) {
    const std::size_t at = random() % boxes.size(), other = random() % boxes.size();
    switch (random() % 8) {
      case 0:
        boxes.erase(boxes.begin() + static_cast<std::ptrdiff_t>(at));
        break;
      case 1:
        boxes.insert(boxes.begin() + static_cast<std::ptrdiff_t>(at), std::string(boxes[other]));
        break;
      case 2:
        std::swap(boxes[at], boxes[other]);
        break;
      case 3: {  // the statement of XXH3 and size is the end of the third box
        constexpr std::size_t kStatement = 16;
        if (boxes.size() < 3 || boxes[2].size() < kStatement) break;
        boxes[2][boxes[2].size() - 1 - random() % kStatement] = static_cast<char>(random());
        break;
      }
      default:
        change_box(boxes[at], random);
    }
  }
  std::string bytes;
  for (const std::string& box : boxes) bytes += box;
  return bytes;
}

}  // namespace raystage::testing
